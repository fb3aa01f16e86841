#include "engine/image/image_bins.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "engine/common/dem_types.h"

namespace terrace::dem {
namespace {

constexpr std::int64_t kMaxBins = std::int64_t{1} << 26;  // a gigabyte
constexpr int kPixelsAtOnce = 1 << 22;

}  // namespace

ImageBins::Neighbors ImageBins::Around(double position, int side, int last) {
  // Clamped to the centres of the first and the last square: the edge's colour continues beyond them.
  const double at = std::clamp(position / side - 0.5, 0.0, static_cast<double>(last));
  const int lower = static_cast<int>(at);
  return {lower, std::min(lower + 1, last), at - lower};
}

Result<ImageBins> ImageBins::Read(ImageFile& image, int side, const std::vector<Position>& positions,
                                  const std::stop_token& stop) {
  ImageBins bins;
  bins.side_ = side;
  bins.last_col_ = (image.width() - 1) / side;
  bins.last_row_ = (image.height() - 1) / side;
  std::vector<bool> is_needed(static_cast<std::size_t>(bins.last_col_) + 1);
  int west = std::numeric_limits<int>::max(), east = -1, north = west, south = -1;
  for (const Position& p : positions) {
    if (std::isnan(p.x) || std::isnan(p.y)) continue;
    const Neighbors x = Around(p.x, side, bins.last_col_), y = Around(p.y, side, bins.last_row_);
    is_needed[static_cast<std::size_t>(x.lower)] = is_needed[static_cast<std::size_t>(x.upper)] = true;
    west = std::min(west, x.lower);
    east = std::max(east, x.upper);
    north = std::min(north, y.lower);
    south = std::max(south, y.upper);
  }
  if (east < 0) return bins;
  bins.ChooseColumns(is_needed, west, east);
  bins.first_row_ = north;
  bins.rows_ = south - north + 1;
  if (std::int64_t{bins.cols_} * bins.rows_ > kMaxBins) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "{}: {} x {} of its pixels are needed at once; cut it to the DEM, and to the DEM's resolution, with "
        "gdalwarp -te -tr",
        image.path(), bins.cols_, bins.rows_);
  }
  bins.bins_.resize(Area(bins.cols_, bins.rows_));
  if (auto filled = bins.Fill(image, stop); !filled) return tl::unexpected(filled.error());
  return bins;
}

// Leaves out the widest gap between needed columns if it is wider than all that remain: where an image around the Earth
// begins and ends within a tile, the tile needs only its first and its last columns.
void ImageBins::ChooseColumns(const std::vector<bool>& is_needed, int west, int east) {
  first_col_ = west;
  cols_ = east - west + 1;
  int after = west;  // the first column after a needed one
  for (int col = west; col <= east; ++col) {
    if (!is_needed[static_cast<std::size_t>(col)]) continue;
    if (col - after > gap_) {
      gap_ = col - after;
      gap_end_ = col;
    }
    after = col + 1;
  }
  if (2 * gap_ <= cols_) gap_ = 0;
  cols_ -= gap_;
}

Result<void> ImageBins::Fill(ImageFile& image, const std::stop_token& stop) {
  if (gap_ == 0) return FillColumns(image, first_col_, cols_, stop);
  const int before = gap_end_ - gap_ - first_col_;
  if (auto filled = FillColumns(image, first_col_, before, stop); !filled) return filled;
  return FillColumns(image, gap_end_, cols_ - before, stop);
}

Result<void> ImageBins::FillColumns(ImageFile& image, int first_col, int cols, const std::stop_token& stop) {
  const int west = first_col * side_, north = first_row_ * side_;
  const int east = std::min((first_col + cols) * side_, image.width()),
            south = std::min((first_row_ + rows_) * side_, image.height());
  const int width = east - west, rows_at_once = std::clamp(kPixelsAtOnce / width, 1, south - north);
  std::vector<Rgba> pixels(Area(width, rows_at_once));
  for (int row = north; row < south; row += rows_at_once) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: reading it was stopped", image.path());
    const int rows = std::min(rows_at_once, south - row);
    if (auto read = image.Read(west, row, width, rows, pixels.data()); !read) return read;
    const Rgba* pixel = pixels.data();
    for (int y = row; y < row + rows; ++y) {
      Bin* const bins = bins_.data() + static_cast<std::ptrdiff_t>(y / side_ - first_row_) * cols_ + Column(first_col);
      for (int x = 0; x < width; ++x, ++pixel) {
        if ((*pixel)[3] == 0) continue;
        Bin& bin = bins[x / side_];
        for (std::size_t i = 0; i < 3; ++i) bin.sums[i] += (*pixel)[i];
        ++bin.count;
      }
    }
  }
  return {};
}

Rgba ImageBins::At(Position position) const {
  if (std::isnan(position.x) || std::isnan(position.y)) return {};
  const Neighbors x = Around(position.x, side_, last_col_), y = Around(position.y, side_, last_row_);
  std::array<double, 3> sums{};
  double whole = 0;
  const auto add = [&](int col, int row, double share) {
    const Bin& bin = bins_[IndexAt(Column(col), row - first_row_, cols_)];
    if (bin.count == 0 || share == 0) return;
    for (std::size_t i = 0; i < 3; ++i) sums[i] += share * bin.sums[i] / bin.count;
    whole += share;
  };
  add(x.lower, y.lower, (1 - x.share) * (1 - y.share));
  add(x.upper, y.lower, x.share * (1 - y.share));
  add(x.lower, y.upper, (1 - x.share) * y.share);
  add(x.upper, y.upper, x.share * y.share);
  if (whole == 0) return {};
  const auto level = [&](double sum) { return static_cast<std::uint8_t>(sum / whole + 0.5); };
  return {level(sums[0]), level(sums[1]), level(sums[2]), 255};
}

}  // namespace terrace::dem

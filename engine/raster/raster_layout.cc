#include "engine/raster/raster_layout.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string_view>

#include "engine/gdal/raster_file.h"
#include "engine/raster/block_averages.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {
namespace {

// The input of averaging: the samples, or an overview with blocks of `start` x `start` samples.
struct Level {
  GDALRasterBand* band;
  int start;
  GridAxis columns, rows;  // of blocks of `start`
  OverviewAxis x, y;
  bool is_band;  // block i is sample i of the band
};

Result<Level> StartingLevel(GDALDataset& dataset, const RasterLayout& layout, int factor) {
  GDALRasterBand* band = dataset.GetRasterBand(1);
  const int start = StartingFactor(layout, factor);
  if (start > 1) band = FindOverview(*band, start);
  if (band == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "its overview of factor {} is gone since it was opened", start);
  }
  const GridAxis columns(layout.columns, start, layout.wraps), rows(layout.height, start, false);
  const bool is_whole = layout.width % start == 0 && layout.height % start == 0;
  const bool is_own = !is_whole && HasOwnOverviews(dataset);
  return Level{band,
               start,
               columns,
               rows,
               {columns, layout.width, band->GetXSize(), is_own},
               {rows, layout.height, band->GetYSize(), is_own},
               is_whole || is_own};
}

Result<void> VisitWindow(GDALRasterBand& band, const SampleRules& rules, const GridWindow& window, const AddRows& add,
                         const std::stop_token& stop) {
  return VisitHeights(band, rules, static_cast<int>(window.column), static_cast<int>(window.row),
                      static_cast<int>(window.columns), static_cast<int>(window.rows), add, stop);
}

// Reads samples of an overview; the column after the last one is the first.
Result<std::vector<float>> ReadSamples(const Level& level, const SampleRules& rules, const GridWindow& window,
                                       const std::stop_token& stop) {
  std::vector<float> samples(static_cast<std::size_t>(window.columns * window.rows));
  const auto read = [&](std::int64_t column, std::int64_t columns, float* out) {
    const auto copy = [&](const float* heights, std::int64_t rows) {
      CopyRows(heights, columns, rows, out, window.columns);
      out += rows * window.columns;
    };
    return VisitWindow(*level.band, rules, {column, window.row, columns, window.rows}, copy, stop);
  };
  const std::int64_t here = std::min(window.columns, level.x.samples() - window.column);
  if (auto done = read(window.column, here, samples.data()); !done) return tl::unexpected(done.error());
  if (here == window.columns) return samples;
  if (auto done = read(0, 1, samples.data() + here); !done) return tl::unexpected(done.error());
  return samples;
}

// Interpolates blocks of level.start between the overview's samples, and passes them on row by row. Precondition: the
// window does not wrap.
Result<void> InterpolateBlocks(const Level& level, const SampleRules& rules, const GridWindow& window,
                               const AddRows& add, const std::stop_token& stop) {
  std::vector<GridAxis::Location> columns;
  for (std::int64_t c = 0; c < window.columns; ++c) columns.push_back(level.x.Around(window.column + c));
  const auto end = [](const GridAxis::Location& place) { return place.index + (place.weight > 0 ? 2 : 1); };
  GridWindow around{columns.front().index, level.y.Around(window.row).index, 0, 0};
  around.columns = end(columns.back()) - around.column;
  around.rows = end(level.y.Around(window.row + window.rows - 1)) - around.row;
  const auto samples = ReadSamples(level, rules, around, stop);
  if (!samples) return tl::unexpected(samples.error());
  std::vector<double> line(static_cast<std::size_t>(around.columns));
  std::vector<float> blocks(columns.size());
  for (std::int64_t r = 0; r < window.rows; ++r) {
    float* out = blocks.data();
    const GridAxis::Location y = level.y.Around(window.row + r);
    const float* const upper = samples->data() + (y.index - around.row) * around.columns;
    const float* const lower = y.weight > 0 ? upper + around.columns : upper;
    for (std::size_t i = 0; i < line.size(); ++i) line[i] = upper[i] * (1 - y.weight) + lower[i] * y.weight;
    for (const GridAxis::Location& x : columns) {
      const double* const at = line.data() + (x.index - around.column);
      double height = x.weight > 0 ? at[0] + x.weight * (at[1] - at[0]) : at[0];
      if (std::isnan(height)) {
        height = Interpolate(*samples, around, {x.index, y.index, x.weight, y.weight}).value_or(SampleRules::kVoid);
      }
      *out++ = static_cast<float>(height);
    }
    add(blocks.data(), 1);
  }
  return {};
}

}  // namespace

RasterLayout RasterLayout::Of(GDALDataset& dataset, const Georeference& georeference, const std::string& crs_unit) {
  RasterLayout layout;
  layout.width = georeference.width();
  layout.height = georeference.height();
  layout.wraps = georeference.wrap_columns() > 0;
  layout.columns = layout.wraps ? georeference.wrap_columns() : layout.width;
  layout.rules = SampleRules::Of(HeightBand(dataset), crs_unit);
  layout.overview_factors = OverviewFactors(HeightBand(dataset));
  return layout;
}

bool HasOwnOverviews(GDALDataset& dataset) {
  const std::string_view driver = dataset.GetDriverName();
  if (driver != "JPEG" && !driver.starts_with("JP2")) return false;
  return !HasFileEndingWith(dataset, ".ovr");  // GDAL's go before the format's
}

double PixelsPerSample(GDALDataset& dataset, int factor, int pixels, int samples) {
  return HasOwnOverviews(dataset) ? factor : static_cast<double>(pixels) / samples;
}

GridAxis::Location OverviewAxis::Around(std::int64_t block) const {
  if (is_own_) return {block, 0};
  // In halves of pixels, to stay in integers: centre * samples / pixels - 1/2.
  const auto centre = static_cast<std::int64_t>(2 * blocks_.Center(block));
  const std::int64_t place = centre * samples_ - pixels_, unit = 2 * pixels_;
  if (place < 0) return {0, 0};
  const std::int64_t index = place / unit;
  if (index < samples_ - 1) return {index, static_cast<double>(place % unit) / static_cast<double>(unit)};
  if (!blocks_.wraps()) return {samples_ - 1, 0};
  const double size = static_cast<double>(pixels_) / static_cast<double>(samples_);
  const double last = static_cast<double>(pixels_) - size / 2, first = blocks_.samples() + size / 2;
  if (!(first > last)) return {samples_ - 1, 0};
  return {samples_ - 1, std::clamp((blocks_.Center(block) - last) / (first - last), 0.0, 1.0)};
}

int StartingFactor(const RasterLayout& layout, int factor) {
  int start = 1;
  for (const int overview : layout.overview_factors) {
    if (overview <= factor) start = overview;
  }
  return start;
}

double GridAxis::Center(std::int64_t index) const {
  std::int64_t block = index, turns = 0;
  if (wraps_ && (index < 0 || index >= count_)) {
    block = FloorMod(index, count_);
    turns = (index - block) / count_;  // exact
  }
  const std::int64_t begin = block * factor_;
  const std::int64_t end = std::min<std::int64_t>(begin + factor_, samples_);
  return static_cast<double>(begin + end) / 2 + static_cast<double>(turns * samples_);
}

GridAxis::Location GridAxis::LocateNearEnd(double position) const {
  // Whole turns first: the last block of each may be smaller than the others.
  const double turns = wraps_ ? std::floor(position / samples_) : 0;
  auto index = static_cast<std::int64_t>(std::floor((position - turns * samples_) * per_factor_ - 0.5)) +
               static_cast<std::int64_t>(turns) * count_;
  // The centre of the last block may be nearer than a whole factor.
  if ((wraps_ || index + 1 < count_) && position >= Center(index + 1)) ++index;
  if (!wraps_) {
    if (index < 0) return {0, 0};
    if (index >= count_ - 1) return {count_ - 1, 0};
  }
  const double here = Center(index), next = Center(index + 1);
  return {index, std::clamp((position - here) / (next - here), 0.0, 1.0)};
}

GDALRasterBand* FindOverview(GDALRasterBand& band, int factor) {
  GDALDataset* const dataset = band.GetDataset();
  const bool is_own = dataset != nullptr && HasOwnOverviews(*dataset);
  const auto fits = [&](int samples, int pixels) {
    if (samples == pixels / factor && samples > 0) return !is_own || pixels % factor == 0;
    return samples == (pixels + factor - 1) / factor;
  };
  for (int i = 0; i < band.GetOverviewCount(); ++i) {
    GDALRasterBand* overview = band.GetOverview(i);
    if (overview == nullptr) continue;
    if (fits(overview->GetXSize(), band.GetXSize()) && fits(overview->GetYSize(), band.GetYSize())) return overview;
  }
  return nullptr;
}

std::vector<int> OverviewFactors(GDALRasterBand& band) {
  std::vector<int> factors;
  for (int factor = 2; factor <= 1 << 16 && factor < std::max(band.GetXSize(), band.GetYSize()); factor *= 2) {
    if (FindOverview(band, factor) != nullptr) factors.push_back(factor);
  }
  return factors;
}

Result<std::vector<float>> ReadAverages(GDALDataset& dataset, const RasterLayout& layout, int factor,
                                        const GridWindow& window, const std::stop_token& stop) {
  const auto level = StartingLevel(dataset, layout, factor);
  if (!level) return tl::unexpected(level.error());
  return AverageBlocks(level->columns, level->rows, level->start, factor / level->start, window,
                       [&](const GridWindow& blocks, const AddRows& add) {
                         return level->is_band ? VisitWindow(*level->band, layout.rules, blocks, add, stop)
                                               : InterpolateBlocks(*level, layout.rules, blocks, add, stop);
                       });
}

}  // namespace terrace::dem

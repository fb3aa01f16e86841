#include "engine/dem/sample_grid.h"

#include <algorithm>
#include <cmath>

#include "engine/dem/block_averages.h"

namespace terrace::dem {
namespace {

constexpr std::int64_t kSamplesPerStrip = std::int64_t{1} << 20;

std::int64_t FloorMod(std::int64_t value, std::int64_t modulus) { return (value % modulus + modulus) % modulus; }

// The band to read and how many of its samples, per axis, make one sample of the grid.
struct Level {
  GDALRasterBand* band;
  int block;
  int columns, rows;  // of the band in use
};

Result<Level> StartingLevel(GDALDataset& dataset, const RasterLayout& layout, int factor) {
  GDALRasterBand* band = dataset.GetRasterBand(1);
  const int start = StartingFactor(layout, factor);
  if (start > 1) band = FindOverview(*band, start);
  if (band == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "its overview of factor {} is gone since it was opened", start);
  }
  return Level{band, factor / start, (layout.columns + start - 1) / start, (layout.height + start - 1) / start};
}

// Blocks `column` .. `column + columns` without wrapping, all rows of the window, into columns of `out` that is
// `stride` wide.
Result<void> ReadBlocks(const Level& level, const SampleRules& rules, const GridWindow& window, float* out,
                        std::int64_t stride, const std::stop_token& stop) {
  const std::int64_t first = window.column * level.block;
  const std::int64_t count = std::min<std::int64_t>(level.columns - first, window.columns * level.block);
  const std::int64_t top = window.row * level.block;
  const std::int64_t rows = std::min<std::int64_t>(level.rows - top, window.rows * level.block);
  // In sample rows: a row of blocks can be the whole raster.
  const std::int64_t strip = std::max<std::int64_t>(1, kSamplesPerStrip / count);
  const bool is_plain = level.block == 1 && count == window.columns;
  std::vector<float> samples;
  BlockAverages averages(is_plain ? 0 : window.columns, level.block);
  for (std::int64_t done = 0; done < rows; done += strip) {
    const std::int64_t here = std::min(strip, rows - done);
    samples.resize(static_cast<std::size_t>(count * here));
    if (auto read = ReadHeights(*level.band, rules, static_cast<int>(first), static_cast<int>(top + done),
                                static_cast<int>(count), static_cast<int>(here), samples.data(), stop);
        !read) {
      return read;
    }
    if (is_plain) {
      CopyRows(samples, count, out + done * stride, stride);
      continue;
    }
    for (std::int64_t r = 0; r < here; ++r) {
      averages.AddRow(samples.data() + r * count, count);
      const std::int64_t at = done + r;
      if ((at + 1) % level.block == 0 || at + 1 == rows) averages.Take(out + at / level.block * stride);
    }
  }
  return {};
}

}  // namespace

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

GridAxis::Place GridAxis::Locate(double position) const {
  // floor, without a call: processors without SSE 4.1 have no instruction for it.
  const double place = position / factor_ - 0.5;
  auto index = static_cast<std::int64_t>(place);
  if (static_cast<double>(index) > place) --index;
  // The last block's centre may lie nearer than a factor.
  if ((wraps_ || index + 1 < count_) && position >= Center(index + 1)) ++index;
  if (!wraps_) {
    if (index < 0) return {0, 0};
    if (index >= count_ - 1) return {count_ - 1, 0};
  }
  const double here = Center(index), next = Center(index + 1);
  return {index, std::clamp((position - here) / (next - here), 0.0, 1.0)};
}

GDALRasterBand* FindOverview(GDALRasterBand& band, int factor) {
  const int columns = (band.GetXSize() + factor - 1) / factor, rows = (band.GetYSize() + factor - 1) / factor;
  for (int i = 0; i < band.GetOverviewCount(); ++i) {
    GDALRasterBand* overview = band.GetOverview(i);
    if (overview != nullptr && overview->GetXSize() == columns && overview->GetYSize() == rows) return overview;
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

Result<std::vector<float>> ReadGrid(GDALDataset& dataset, const RasterLayout& layout, int factor,
                                    const GridWindow& window, const std::stop_token& stop) {
  const auto level = StartingLevel(dataset, layout, factor);
  if (!level) return tl::unexpected(level.error());
  const std::int64_t count = GridAxis(layout.columns, factor, layout.wraps).count();
  std::vector<float> heights(static_cast<std::size_t>(window.columns * window.rows));
  for (std::int64_t done = 0; done < window.columns;) {
    GridWindow part = window;
    part.column = FloorMod(window.column + done, count);
    part.columns = std::min(window.columns - done, count - part.column);
    if (auto read = ReadBlocks(*level, layout.rules, part, heights.data() + done, window.columns, stop); !read) {
      return tl::unexpected(read.error());
    }
    done += part.columns;
  }
  return heights;
}

}  // namespace terrace::dem

#include "engine/dem/raster/sample_grid.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>

#include "engine/dem/raster/block_averages.h"
#include "engine/dem/raster/grid_cells.h"
#include "engine/dem/raster/overview_axis.h"

namespace terrace::dem {
namespace {

constexpr std::int64_t kSamplesPerStrip = std::int64_t{1} << 20;

std::int64_t FloorMod(std::int64_t value, std::int64_t modulus) { return (value % modulus + modulus) % modulus; }

// The input of averaging: the samples, or an overview with blocks of `start` x `start` samples.
struct Level {
  GDALRasterBand* band;
  int start;
  int block;               // number of these blocks, per axis, in a block of the grid
  GridAxis columns, rows;  // of blocks of `start`
  OverviewAxis x, y;
  bool is_band;  // block i is sample i of the band

  double ColumnShare(std::int64_t column) const { return ShareOf(column, start, columns.samples()); }
  double RowShare(std::int64_t row) const { return ShareOf(row, start, rows.samples()); }
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
               factor / start,
               columns,
               rows,
               {columns, layout.width, band->GetXSize(), is_own},
               {rows, layout.height, band->GetYSize(), is_own},
               is_whole || is_own};
}

// Reads samples of an overview; the column after the last one is the first.
Result<std::vector<float>> ReadSamples(const Level& level, const SampleRules& rules, const GridWindow& window,
                                       const std::stop_token& stop) {
  std::vector<float> samples(static_cast<std::size_t>(window.columns * window.rows));
  const auto read = [&](std::int64_t column, std::int64_t columns, float* out) {
    return ReadHeights(*level.band, rules, static_cast<int>(column), static_cast<int>(window.row),
                       static_cast<int>(columns), static_cast<int>(window.rows), out, stop);
  };
  const std::int64_t here = std::min(window.columns, level.x.samples() - window.column);
  if (auto done = read(window.column, here, samples.data()); !done) return tl::unexpected(done.error());
  if (here == window.columns) return samples;
  std::vector<float> first(static_cast<std::size_t>(window.rows));
  if (auto done = read(0, 1, first.data()); !done) return tl::unexpected(done.error());
  std::vector<float> both(samples.size());
  CopyRows(std::span(samples).first(static_cast<std::size_t>(here * window.rows)), here, both.data(), window.columns);
  CopyRows(first, 1, both.data() + here, window.columns);
  return both;
}

// Interpolates blocks of level.start between the overview's samples. Precondition: the window does not wrap.
Result<void> InterpolateBlocks(const Level& level, const SampleRules& rules, const GridWindow& window, float* out,
                               const std::stop_token& stop) {
  std::vector<GridAxis::Location> columns;
  for (std::int64_t c = 0; c < window.columns; ++c) columns.push_back(level.x.Around(window.column + c));
  const auto end = [](const GridAxis::Location& place) { return place.index + (place.weight > 0 ? 2 : 1); };
  GridWindow around{columns.front().index, level.y.Around(window.row).index, 0, 0};
  around.columns = end(columns.back()) - around.column;
  around.rows = end(level.y.Around(window.row + window.rows - 1)) - around.row;
  const auto samples = ReadSamples(level, rules, around, stop);
  if (!samples) return tl::unexpected(samples.error());
  std::vector<double> line(static_cast<std::size_t>(around.columns));
  for (std::int64_t r = 0; r < window.rows; ++r) {
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
  }
  return {};
}

// Blocks `column` .. `column + columns` without wrapping, all rows of the window, into columns of `out` that is
// `stride` wide.
Result<void> ReadBlocks(const Level& level, const SampleRules& rules, const GridWindow& window, float* out,
                        std::int64_t stride, const std::stop_token& stop) {
  const std::int64_t first = window.column * level.block;
  const std::int64_t count = std::min<std::int64_t>(level.columns.count() - first, window.columns * level.block);
  const std::int64_t top = window.row * level.block;
  const std::int64_t rows = std::min<std::int64_t>(level.rows.count() - top, window.rows * level.block);
  // Reads a limited number of sample rows at a time, because a row of blocks can be the whole raster.
  const std::int64_t strip = std::max<std::int64_t>(1, kSamplesPerStrip / count);
  const bool is_plain = level.block == 1 && count == window.columns;
  // Not initialized, because it is written before it is read.
  const auto samples = std::make_unique_for_overwrite<float[]>(static_cast<std::size_t>(count * std::min(strip, rows)));
  BlockAverages averages(is_plain ? 0 : window.columns, level.block);
  for (std::int64_t done = 0; done < rows; done += strip) {
    const GridWindow here{first, top + done, count, std::min(strip, rows - done)};
    auto read = level.is_band
                    ? ReadHeights(*level.band, rules, static_cast<int>(here.column), static_cast<int>(here.row),
                                  static_cast<int>(here.columns), static_cast<int>(here.rows), samples.get(), stop)
                    : InterpolateBlocks(level, rules, here, samples.get(), stop);
    if (!read) return read;
    if (is_plain) {
      CopyRows({samples.get(), static_cast<std::size_t>(here.columns * here.rows)}, count, out + done * stride, stride);
      continue;
    }
    for (std::int64_t r = 0; r < here.rows; ++r) {
      averages.AddRow(samples.get() + r * count, count, level.RowShare(here.row + r),
                      level.ColumnShare(first + count - 1));
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

GridAxis::Location GridAxis::LocateNearEnd(double position) const {
  auto index = static_cast<std::int64_t>(std::floor(position * per_factor_ - 0.5));
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

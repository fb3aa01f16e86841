#include "engine/dem/raster_scan.h"

#include <algorithm>
#include <cmath>

namespace terrace::dem {
namespace {

// Multiples of the usual storage blocks, so that each is decoded once.
constexpr int kChunkRows = 256, kChunkColumns = 4096;

struct Chunk {
  int col, row, cols, rows;
};

// Calls visit(chunk, heights) for every part of the band, from the north-west, by rows.
template <typename Visit>
Result<void> ForEachChunk(GDALRasterBand& band, const SampleRules& rules, const std::stop_token& stop,
                          const Visit& visit) {
  std::vector<float> heights;
  for (int row = 0; row < band.GetYSize(); row += kChunkRows) {
    for (int col = 0; col < band.GetXSize(); col += kChunkColumns) {
      const Chunk chunk{col, row, std::min(kChunkColumns, band.GetXSize() - col),
                        std::min(kChunkRows, band.GetYSize() - row)};
      heights.resize(static_cast<std::size_t>(chunk.cols) * static_cast<std::size_t>(chunk.rows));
      if (auto read = ReadHeights(band, rules, chunk.col, chunk.row, chunk.cols, chunk.rows, heights.data(), stop);
          !read) {
        return read;
      }
      visit(chunk, heights);
    }
  }
  return {};
}

struct Mean {
  double sum = 0;
  std::int64_t count = 0;

  void Add(const float* heights, int samples) {
    for (int i = 0; i < samples; ++i) {
      if (std::isnan(heights[i])) continue;
      sum += heights[i];
      ++count;
    }
  }
  std::optional<double> value() const {
    return count == 0 ? std::nullopt : std::optional(sum / static_cast<double>(count));
  }
};

}  // namespace

Result<RasterScan> ScanRaster(GDALDataset& dataset, const RasterLayout& layout,
                              const std::function<void(double)>& progress, const std::stop_token& stop) {
  GDALRasterBand& band = *dataset.GetRasterBand(1);
  RasterScan scan;
  scan.table = RangeTable(layout.width, layout.height);
  Mean first_row, last_row;
  const double samples = static_cast<double>(layout.width) * layout.height;
  double seen = 0;
  auto read = ForEachChunk(band, layout.rules, stop, [&](const Chunk& chunk, const std::vector<float>& heights) {
    scan.table.AddWindow(chunk.col, chunk.row, chunk.cols, chunk.rows, heights.data());
    scan.voids += static_cast<std::uint64_t>(std::ranges::count_if(heights, [](float h) { return std::isnan(h); }));
    scan.zeros.Add(heights.data(), chunk.cols, chunk.rows, chunk.col == 0, chunk.row == 0,
                   chunk.col + chunk.cols == layout.width, chunk.row + chunk.rows == layout.height);
    const int used = std::clamp(layout.columns - chunk.col, 0, chunk.cols);
    if (chunk.row == 0) first_row.Add(heights.data(), used);
    if (chunk.row + chunk.rows == layout.height) {
      last_row.Add(heights.data() + heights.size() - static_cast<std::size_t>(chunk.cols), used);
    }
    seen += static_cast<double>(heights.size());
    if (progress) progress(seen / samples);
  });
  if (!read) return tl::unexpected(read.error());
  scan.valid = static_cast<std::uint64_t>(layout.width) * static_cast<std::uint64_t>(layout.height) - scan.voids;
  if (scan.valid == 0) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "has no valid sample, only voids; check its nodata value with gdalinfo and "
                     "correct it with `gdal_translate -a_nodata VALUE in out`");
  }
  RangeTable samples_only = scan.table;
  samples_only.Finish();
  scan.lowest = samples_only.Whole().min;
  scan.highest = samples_only.Whole().max;
  scan.edge_row_means = {first_row.value(), last_row.value()};

  for (const int factor : layout.overview_factors) {
    read = ForEachChunk(*FindOverview(band, factor), layout.rules, stop,
                        [&](const Chunk& chunk, const std::vector<float>& heights) {
                          scan.table.AddWindow(chunk.col, chunk.row, chunk.cols, chunk.rows, heights.data(), factor);
                        });
    if (!read) return tl::unexpected(read.error());
  }
  scan.table.Finish();
  return scan;
}

}  // namespace terrace::dem

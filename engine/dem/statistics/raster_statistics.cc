#include "engine/dem/statistics/raster_statistics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/plain_number.h"
#include "engine/dem/statistics/coarse_errors.h"

namespace terrace::dem {
namespace {

// Samples per side of one read of an overview: a multiple of the usual storage blocks, so that each is decoded once.
constexpr int kStripRows = 256, kStripColumns = 4096;

std::optional<double> MeanOf(const BlockSum& sum) {
  return sum.weight == 0 ? std::nullopt : std::optional(sum.sum / sum.weight);
}

}  // namespace

CoarseAverages CoarseAverages::ShapedFor(const RasterLayout& layout) {
  CoarseAverages coarse;
  for (int factor = kLargestDirect; factor <= AveragingErrors(layout.width, layout.height).largest_factor();
       factor *= 2) {
    Grid grid{DivideUp(layout.columns, factor), DivideUp(layout.height, factor), {}};
    grid.heights.resize(static_cast<std::size_t>(grid.columns * grid.rows), SampleRules::kVoid);
    coarse.grids.push_back(std::move(grid));
  }
  return coarse;
}

bool CoarseAverages::Has(int factor) const {
  return !grids.empty() && factor >= kLargestDirect && (factor & (factor - 1)) == 0;
}

std::vector<float> CoarseAverages::Read(int factor, const GridWindow& window) const {
  std::size_t index = 0;
  while (index + 1 < grids.size() && (kLargestDirect << index) < factor) ++index;
  const Grid& grid = grids[index];
  std::vector<float> heights;
  heights.reserve(static_cast<std::size_t>(window.columns * window.rows));
  for (std::int64_t r = window.row; r < window.row + window.rows; ++r) {
    for (std::int64_t c = window.column; c < window.column + window.columns; ++c) {
      const std::int64_t column = (c % grid.columns + grid.columns) % grid.columns;
      heights.push_back(grid.heights[static_cast<std::size_t>(r * grid.columns + column)]);
    }
  }
  return heights;
}

std::size_t RasterStatistics::bytes() const {
  std::size_t bytes = sizeof(RasterStatistics) + table.bytes();
  for (const AveragingErrors::Level& level : errors.levels()) bytes += level.errors.size() * sizeof(float);
  for (const CoarseAverages::Grid& grid : coarse.grids) bytes += grid.heights.size() * sizeof(float);
  return bytes;
}

StatisticsAssembler::StatisticsAssembler(const RasterLayout& layout)
    : layout_(layout),
      voids_(layout.columns, layout.height, [this](int row, int first, int last, std::int64_t samples) {
        // A hole of one sample is filled from its neighbours, whose heights are in the ranges of every box with this
        // sample.
        if (samples > 1) statistics_.table.MarkHole(row, first, last);
        statistics_.hole_samples += static_cast<std::uint64_t>(last - first + 1);
      }) {
  statistics_.table = RangeTable(layout.width, layout.height);
  statistics_.errors = AveragingErrors(layout.width, layout.height);
  if (!layout.overview_factors.empty()) return;
  statistics_.coarse = CoarseAverages::ShapedFor(layout);
  largest_sums_.resize(static_cast<std::size_t>(DivideUp(layout.columns, ChunkGrid::kSide)) *
                       static_cast<std::size_t>(DivideUp(layout.height, ChunkGrid::kSide)));
}

void StatisticsAssembler::Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics) {
  statistics_.table.AddBlocks(chunk.col / RangeTable::kBlock, chunk.row / RangeTable::kBlock,
                              DivideUp(chunk.cols, RangeTable::kBlock), chunk_statistics.ranges);
  statistics_.valid += static_cast<std::uint64_t>(chunk_statistics.valid);
  statistics_.zeros.Add(chunk_statistics.zeros);
  voids_.Add(chunk, chunk_statistics);
  first_row_.Add(chunk_statistics.first_row);
  last_row_.Add(chunk_statistics.last_row);
  for (std::size_t k = 0; k < chunk_statistics.errors.size(); ++k) {
    const int factor = 2 << k, pixels = AveragingErrors::BlockPixels(factor), columns = DivideUp(chunk.cols, pixels);
    for (std::size_t i = 0; i < chunk_statistics.errors[k].size(); ++i) {
      statistics_.errors.Raise(factor, chunk.col / pixels + static_cast<int>(i) % columns,
                               chunk.row / pixels + static_cast<int>(i) / columns, chunk_statistics.errors[k][i]);
    }
  }
  if (layout_.overview_factors.empty() && chunk.col < layout_.columns) AddSums(chunk, chunk_statistics);
}

void StatisticsAssembler::AddSums(const Chunk& chunk, const ChunkStatistics& chunk_statistics) {
  const int used = std::min(chunk.cols, layout_.columns - chunk.col);
  const auto place = [&](int factor, const auto& values, const auto& put) {
    const int columns = DivideUp(used, factor);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::int64_t column = chunk.col / factor + static_cast<int>(i) % columns;
      const std::int64_t row = chunk.row / factor + static_cast<int>(i) / columns;
      put(column, row, values[i]);
    }
  };
  for (std::size_t k = 0; k < statistics_.coarse.grids.size(); ++k) {
    const int factor = kLargestDirect << k;
    CoarseAverages::Grid& grid = statistics_.coarse.grids[k];
    if (k == 0) {
      place(factor, chunk_statistics.averages.back(), [&](std::int64_t column, std::int64_t row, float height) {
        grid.heights[static_cast<std::size_t>(row * grid.columns + column)] = height;
      });
    } else if (k - 1 < chunk_statistics.sums.size()) {
      place(factor, chunk_statistics.sums[k - 1], [&](std::int64_t column, std::int64_t row, const BlockSum& sum) {
        grid.heights[static_cast<std::size_t>(row * grid.columns + column)] = sum.Mean();
        if (factor != ChunkGrid::kSide) return;
        largest_sums_[static_cast<std::size_t>(row * DivideUp(layout_.columns, factor) + column)] = sum;
      });
    }
  }
}

Result<void> StatisticsAssembler::FinishCoarse(GDALDataset& dataset, const std::stop_token& stop) {
  CoarseAverages& coarse = statistics_.coarse;
  if (!coarse.grids.empty()) {
    // Adds sums of chunks row by row, in the order of BlockAverages.
    const int columns = DivideUp(layout_.columns, ChunkGrid::kSide), rows = DivideUp(layout_.height, ChunkGrid::kSide);
    for (std::size_t k = 0; k < coarse.grids.size(); ++k) {
      const int chunks = (kLargestDirect << k) / ChunkGrid::kSide;
      if (chunks < 2) continue;
      CoarseAverages::Grid& grid = coarse.grids[k];
      std::vector<BlockSum> sums(grid.heights.size());
      for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) {
          sums[static_cast<std::size_t>(r / chunks * grid.columns + c / chunks)].Add(
              largest_sums_[static_cast<std::size_t>(r * columns + c)]);
        }
      }
      std::ranges::transform(sums, grid.heights.begin(), &BlockSum::Mean);
    }
    AddCoarseErrors(layout_, coarse, statistics_.errors);
    return {};
  }
  if (statistics_.errors.largest_factor() <= kLargestDirect) return {};
  CoarseAverages overviews = CoarseAverages::ShapedFor(layout_);
  int factor = kLargestDirect;
  for (CoarseAverages::Grid& grid : overviews.grids) {
    auto heights = ReadGrid(dataset, layout_, factor, {0, 0, grid.columns, grid.rows}, stop);
    if (!heights) return tl::unexpected(heights.error());
    grid.heights = *std::move(heights);
    factor *= 2;
  }
  AddCoarseErrors(layout_, overviews, statistics_.errors);
  return {};
}

Result<void> StatisticsAssembler::AddOverviews(GDALDataset& dataset, const std::stop_token& stop) {
  for (const int factor : layout_.overview_factors) {
    const int columns = DivideUp(layout_.columns, factor), rows = DivideUp(layout_.height, factor);
    for (int row = 0; row < rows; row += kStripRows) {
      for (int column = 0; column < columns; column += kStripColumns) {
        const Chunk box{column, row, std::min(kStripColumns, columns - column), std::min(kStripRows, rows - row)};
        const auto heights = ReadGrid(dataset, layout_, factor, {box.col, box.row, box.cols, box.rows}, stop);
        if (!heights) return tl::unexpected(heights.error());
        statistics_.table.AddWindow(box.col, box.row, box.cols, box.rows, heights->data(), factor);
      }
    }
  }
  return {};
}

Result<RasterStatistics> StatisticsAssembler::Finish(GDALDataset& dataset, const std::stop_token& stop) {
  statistics_.voids =
      static_cast<std::uint64_t>(layout_.width) * static_cast<std::uint64_t>(layout_.height) - statistics_.valid;
  if (statistics_.valid == 0) {
    return MakeError(
        ErrorCode::kNotFound,
        "has no valid sample, only voids; check its nodata value with gdalinfo and correct it with "
        "`gdal_translate -a_nodata VALUE in out`; heights beyond {} m are voids too: those in another unit "
        "need `-a_scale FACTOR`, the metres of one{}",
        PlainNumber(kMaxAbsHeight),
        layout_.rules.extra_nodata.empty() && layout_.rules.rim <= 0
            ? ""
            : "; heights that the file does not declare to be voids were taken for such: with --nodata declared (in a "
              "configuration \"nodata\": \"declared\") they are not");
  }
  statistics_.rim_voids = voids_.Finish();
  if (statistics_.rim_voids.is_everything()) statistics_.hole_samples = 0;
  const BlockRange samples = statistics_.table.OfFinest();
  statistics_.lowest = samples.min;
  statistics_.highest = samples.max;
  statistics_.edge_row_means = {MeanOf(first_row_), MeanOf(last_row_)};
  if (auto coarse = FinishCoarse(dataset, stop); !coarse) return tl::unexpected(coarse.error());
  if (auto overviews = AddOverviews(dataset, stop); !overviews) return tl::unexpected(overviews.error());
  statistics_.table.Finish();
  return std::move(statistics_);
}

}  // namespace terrace::dem

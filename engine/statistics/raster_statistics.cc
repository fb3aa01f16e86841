#include "engine/statistics/raster_statistics.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "engine/statistics/kept_factors.h"

namespace terrace::dem {
namespace {

// Samples per side of one read of an overview: a multiple of the usual storage blocks, so that each is decoded once.
constexpr int kStripRows = 256, kStripColumns = 4096;

std::optional<double> MeanOf(const BlockSum& sum) {
  return sum.weight == 0 ? std::nullopt : std::optional(sum.sum / sum.weight);
}

// A line of either grid across one axis, and its place in both grids.
struct Line {
  double position = 0;
  GridAxis::Location fine, coarse;
};

std::vector<Line> LinesOf(const GridAxis& fine, const GridAxis& coarse) {
  std::vector<double> positions;
  const std::int64_t around = fine.wraps() ? 1 : 0;
  for (std::int64_t i = -around; i < fine.count() + around; ++i) positions.push_back(fine.Center(i));
  for (std::int64_t i = -around; i < coarse.count() + around; ++i) positions.push_back(coarse.Center(i));
  std::ranges::sort(positions);
  positions.erase(std::unique(positions.begin(), positions.end()), positions.end());
  std::vector<Line> lines;
  for (const double position : positions) lines.push_back({position, fine.Locate(position), coarse.Locate(position)});
  return lines;
}

// The surface between averages, with weights renormalized over valid averages, and the extremes of the averages around.
class Surface {
 public:
  Surface(const CoarseAverages::Grid& grid, bool wraps) : grid_(grid), wraps_(wraps) {}

  struct Corners {
    float lowest = std::numeric_limits<float>::infinity(), highest = -std::numeric_limits<float>::infinity();
    bool has_voids = false;
    bool empty() const { return lowest > highest; }
  };

  double At(const GridAxis::Location& x, const GridAxis::Location& y) const {
    const double upper = Along(x, y.index);
    return y.weight > 0 ? upper + y.weight * (Along(x, y.index + 1) - upper) : upper;
  }

  // Extremes of the averages around the cell of lines that begins here.
  Corners Around(const GridAxis::Location& x, const GridAxis::Location& y) const {
    Corners corners;
    for (const std::int64_t row : {y.index, std::min(y.index + 1, grid_.rows - 1)}) {
      for (const std::int64_t column : {x.index, wraps_ ? x.index + 1 : std::min(x.index + 1, grid_.columns - 1)}) {
        const float height = Height(column, row);
        corners.has_voids |= std::isnan(height);
        if (std::isnan(height)) continue;
        corners.lowest = std::min(corners.lowest, height);
        corners.highest = std::max(corners.highest, height);
      }
    }
    return corners;
  }

 private:
  float Height(std::int64_t column, std::int64_t row) const {
    return grid_.heights[static_cast<std::size_t>(row * grid_.columns + FloorMod(column, grid_.columns))];
  }
  double Along(const GridAxis::Location& x, std::int64_t row) const {
    const double first = Height(x.index, row);
    return x.weight > 0 ? first + x.weight * (Height(x.index + 1, row) - first) : first;
  }

  const CoarseAverages::Grid& grid_;
  const bool wraps_;
};

// The largest difference within the cell between two lines of each axis.
double CellError(const Surface& fine, const Surface& coarse, const Line* x, const Line* y) {
  const Surface::Corners near = fine.Around(x->fine, y->fine), far = coarse.Around(x->coarse, y->coarse);
  if (near.empty()) return 0;  // no samples
  if (far.empty()) return std::numeric_limits<double>::infinity();
  if (near.has_voids || far.has_voids) {
    return std::max(double{far.highest} - near.lowest, double{near.highest} - far.lowest);
  }
  double worst = 0;
  for (const Line* row : {y, y + 1}) {
    for (const Line* column : {x, x + 1}) {
      worst = std::max(worst, std::abs(fine.At(column->fine, row->fine) - coarse.At(column->coarse, row->coarse)));
    }
  }
  return worst;
}

void AddFactor(const RasterLayout& layout, const CoarseAverages& coarse, int factor, AveragingErrors& errors) {
  const auto grid = [&](int of) -> const CoarseAverages::Grid& {
    std::size_t index = 0;
    while ((kLargestMeasuredFactor << index) < of) ++index;
    return coarse.grids[index];
  };
  const Surface near(grid(kLargestMeasuredFactor), layout.wraps), far(grid(factor), layout.wraps);
  const auto columns = LinesOf(GridAxis(layout.columns, kLargestMeasuredFactor, layout.wraps),
                               GridAxis(layout.columns, factor, layout.wraps));
  const auto rows =
      LinesOf(GridAxis(layout.height, kLargestMeasuredFactor, false), GridAxis(layout.height, factor, false));
  const int pixels = AveragingErrors::BlockPixels(factor);
  AveragingErrors::Level differences{errors.level(factor).columns, errors.level(factor).rows, {}};
  differences.errors.resize(errors.level(factor).errors.size());
  const auto block = [&](double position, int count) {
    return std::clamp(static_cast<int>(std::floor(position / pixels)), 0, count - 1);
  };
  // With a single line, the surfaces are constant along this axis.
  const auto steps = [](const std::vector<Line>& lines) { return std::max<std::size_t>(lines.size() - 1, 1); };
  const auto padded = [](std::vector<Line> lines) {
    if (lines.size() == 1) lines.push_back(lines.front());
    return lines;
  };
  const std::vector<Line> xs = padded(columns), ys = padded(rows);
  for (std::size_t j = 0; j < steps(rows); ++j) {
    for (std::size_t i = 0; i < steps(columns); ++i) {
      const double error = CellError(near, far, &xs[i], &ys[j]);
      for (int y = block(ys[j].position, differences.rows); y <= block(ys[j + 1].position, differences.rows); ++y) {
        for (int x = block(xs[i].position, differences.columns); x <= block(xs[i + 1].position, differences.columns);
             ++x) {
          float& known = differences.errors[static_cast<std::size_t>(y * differences.columns + x)];
          known = std::max(known, std::nextafter(static_cast<float>(error), std::numeric_limits<float>::infinity()));
        }
      }
    }
  }
  for (int y = 0; y < differences.rows; ++y) {
    for (int x = 0; x < differences.columns; ++x) {
      const double side = pixels, west = side * x, north = side * y;
      const float own = errors.Largest(kLargestMeasuredFactor, west, north, west + side - 0.5, north + side - 0.5);
      errors.Raise(factor, x, y, differences.errors[static_cast<std::size_t>(y * differences.columns + x)] + own);
    }
  }
}

// Raises the errors of factors above kLargestMeasuredFactor. Compares the surface between averages of such a factor
// with the surface between averages of kLargestMeasuredFactor samples, and adds the known errors of the latter. Both
// surfaces are bilinear between grid lines, so the difference is largest where grid lines cross. Evaluates all
// crossings.
void AddCoarseErrors(const RasterLayout& layout, const CoarseAverages& coarse, AveragingErrors& errors) {
  for (int factor = 2 * kLargestMeasuredFactor; factor <= errors.largest_factor(); factor *= 2) {
    AddFactor(layout, coarse, factor, errors);
  }
}

// Whether averages of an overview are no averages of the samples around them. Averages that include nodata values are
// far from these samples, though often within the range of the whole raster.
bool IsStray(const RangeTable& overview, const RangeTable& samples, const RasterLayout& layout, int factor,
             bool has_voids) {
  // Tolerance for lossy compression, in metres. A raster with voids has only that of rounding, because nodata values
  // may shift averages by less than this.
  constexpr double kMaxLoss = 2;
  // Samples beyond an average's own that kernels reach, if each overview was made from the one before.
  const double reach = 6.0 * factor;
  constexpr int kBlock = RangeTable::kBlock;
  const int columns = DivideUp(layout.width, kBlock);
  for (std::size_t i = 0; i < overview.finest().size(); ++i) {
    const BlockRange& averages = overview.finest()[i];
    if (averages.min > averages.max) continue;
    const double west = static_cast<double>(i % static_cast<std::size_t>(columns)) * kBlock;
    const double north = static_cast<double>(i / static_cast<std::size_t>(columns)) * kBlock;
    const BlockRange around = samples.Query(west - reach, north - reach, west + kBlock + reach, north + kBlock + reach);
    // Beside a cliff, overviews by Lanczos kernels exceed the heights by 18 % of their range, cubic ones by 10 %. Equal
    // heights differ by rounding.
    const double overshoot = 0.25 * (double{around.max} - around.min) + (has_voids ? 0.01 : kMaxLoss);
    if (!(averages.min >= around.min - overshoot && averages.max <= around.max + overshoot)) return true;
  }
  return false;
}

}  // namespace

CoarseAverages CoarseAverages::ShapedFor(const RasterLayout& layout) {
  CoarseAverages coarse;
  for (int factor = kLargestMeasuredFactor; factor <= AveragingErrors(layout.width, layout.height).largest_factor();
       factor *= 2) {
    Grid grid{DivideUp(layout.columns, factor), DivideUp(layout.height, factor), {}};
    grid.heights.resize(static_cast<std::size_t>(grid.columns * grid.rows), SampleRules::kVoid);
    coarse.grids.push_back(std::move(grid));
  }
  return coarse;
}

bool CoarseAverages::Has(int factor) const {
  return !grids.empty() && factor >= kLargestMeasuredFactor && (factor & (factor - 1)) == 0;
}

std::vector<float> CoarseAverages::Read(int factor, const GridWindow& window) const {
  std::size_t index = 0;
  while (index + 1 < grids.size() && (kLargestMeasuredFactor << index) < factor) ++index;
  return grids[index].Read(window);
}

std::vector<float> AveragesGrid::Read(const GridWindow& window) const {
  std::vector<float> read;
  read.reserve(static_cast<std::size_t>(window.columns * window.rows));
  for (std::int64_t r = window.row; r < window.row + window.rows; ++r) {
    for (std::int64_t c = window.column; c < window.column + window.columns; ++c) {
      read.push_back(heights[static_cast<std::size_t>(r * columns + FloorMod(c, columns))]);
    }
  }
  return read;
}

std::size_t RasterStatistics::bytes() const {
  std::size_t bytes = sizeof(RasterStatistics) + ranges.bytes();
  for (const AveragingErrors::Level& level : errors.levels()) bytes += level.errors.size() * sizeof(float);
  for (const CoarseAverages::Grid& grid : coarse.grids) bytes += grid.heights.size() * sizeof(float);
  return bytes;
}

StatisticsAssembler::StatisticsAssembler(const RasterLayout& layout)
    : layout_(layout),
      voids_(layout.columns, layout.height, [this](int row, int first, int last, std::int64_t samples) {
        // A hole of one sample is filled from its neighbours, whose heights are in the ranges of every box with this
        // sample.
        if (samples > 1) statistics_.ranges.MarkHole(row, first, last);
        statistics_.enclosed_samples += static_cast<std::uint64_t>(last - first + 1);
      }) {
  content_.Add(layout.width);
  content_.Add(layout.height);
  statistics_.ranges = RangeTable(layout.width, layout.height);
  statistics_.errors = AveragingErrors(layout.width, layout.height);
  if (!layout.overview_factors.empty()) return;
  statistics_.coarse = CoarseAverages::ShapedFor(layout);
  largest_sums_.resize(Area(DivideUp(layout.columns, ChunkGrid::kSide), DivideUp(layout.height, ChunkGrid::kSide)));
}

void StatisticsAssembler::Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics) {
  content_.Add(chunk_statistics.content);
  statistics_.ranges.AddBlocks(chunk.col / RangeTable::kBlock, chunk.row / RangeTable::kBlock,
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
    const int factor = kLargestMeasuredFactor << k;
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
    // Averages of blocks of several chunks.
    const int columns = DivideUp(layout_.columns, ChunkGrid::kSide), rows = DivideUp(layout_.height, ChunkGrid::kSide);
    const auto last = static_cast<int>(coarse.grids.size()) - 1;
    const int largest = (kLargestMeasuredFactor << last) / ChunkGrid::kSide;
    const auto write = [&](int chunks, std::int64_t row, std::span<const BlockSum> sums) {
      const int factor = chunks * ChunkGrid::kSide / kLargestMeasuredFactor;
      CoarseAverages::Grid& grid =
          coarse.grids[static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(factor)))];
      WriteMeans(sums.first(static_cast<std::size_t>(grid.columns)), grid.heights.data() + row * grid.columns);
    };
    if (largest > 1) {
      BlockSums blocks(columns, largest);
      for (int row = 0; row < rows; ++row) {
        blocks.AddRow(std::span(largest_sums_).subspan(IndexAt(0, row, columns), static_cast<std::size_t>(columns)),
                      write);
      }
      blocks.Finish(write);
    }
    AddCoarseErrors(layout_, coarse, statistics_.errors);
    return {};
  }
  if (statistics_.errors.largest_factor() <= kLargestMeasuredFactor && !KeepsCoarse(layout_)) return {};
  CoarseAverages overviews = CoarseAverages::ShapedFor(layout_);
  int factor = kLargestMeasuredFactor;
  for (CoarseAverages::Grid& grid : overviews.grids) {
    auto heights = ReadAverages(dataset, layout_, factor, {0, 0, grid.columns, grid.rows}, stop);
    if (!heights) return tl::unexpected(heights.error());
    grid.heights = *std::move(heights);
    factor *= 2;
  }
  AddCoarseErrors(layout_, overviews, statistics_.errors);
  if (KeepsCoarse(layout_)) coarse = std::move(overviews);
  return {};
}

Result<void> StatisticsAssembler::AddOverviews(GDALDataset& dataset, const std::stop_token& stop) {
  if (layout_.overview_factors.empty()) return {};
  RangeTable samples = statistics_.ranges;
  samples.Finish();
  for (const int factor : layout_.overview_factors) {
    RangeTable overview(layout_.width, layout_.height);
    content_.Add(factor);
    const int columns = DivideUp(layout_.columns, factor), rows = DivideUp(layout_.height, factor);
    for (int row = 0; row < rows; row += kStripRows) {
      for (int column = 0; column < columns; column += kStripColumns) {
        const Chunk box{column, row, std::min(kStripColumns, columns - column), std::min(kStripRows, rows - row)};
        const auto heights = ReadAverages(dataset, layout_, factor, {box.col, box.row, box.cols, box.rows}, stop);
        if (!heights) return tl::unexpected(heights.error());
        content_.AddBytes(heights->data(), heights->size() * sizeof(float));
        statistics_.ranges.AddWindow(box.col, box.row, box.cols, box.rows, heights->data(), factor);
        overview.AddWindow(box.col, box.row, box.cols, box.rows, heights->data(), factor);
      }
    }
    statistics_.has_stray_overviews |= IsStray(overview, samples, layout_, factor, statistics_.voids > 0);
  }
  return {};
}

Result<RasterStatistics> StatisticsAssembler::Finish(GDALDataset& dataset, const std::stop_token& stop) {
  statistics_.voids =
      static_cast<std::uint64_t>(layout_.width) * static_cast<std::uint64_t>(layout_.height) - statistics_.valid;
  statistics_.rim_voids = voids_.Finish();
  if (statistics_.rim_voids.is_everything()) statistics_.enclosed_samples = 0;
  const BlockRange samples = statistics_.ranges.OfFinest();
  if (statistics_.valid > 0) {
    statistics_.lowest = samples.min;
    statistics_.highest = samples.max;
  }
  statistics_.edge_row_means = {MeanOf(first_row_), MeanOf(last_row_)};
  if (auto coarse = FinishCoarse(dataset, stop); !coarse) return tl::unexpected(coarse.error());
  if (auto overviews = AddOverviews(dataset, stop); !overviews) return tl::unexpected(overviews.error());
  statistics_.ranges.Finish();
  statistics_.content = content_.Hash();
  return std::move(statistics_);
}

}  // namespace terrace::dem

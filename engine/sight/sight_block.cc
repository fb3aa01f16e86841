#include "engine/sight/sight_block.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace terrace::dem {
namespace {

// Metres between positions at which undulations are read.
constexpr double kUndulationStep = 240;

float Larger(float a, float b) { return b > a ? b : a; }  // of a void and a height: the height

// SightBlock::largest.
std::vector<float> LargestOfThree(const std::vector<float>& heights, std::int64_t width, std::int64_t height) {
  std::vector<float> across(heights.size()), largest(heights.size());
  const auto lowest = [](float h) { return Larger(-std::numeric_limits<float>::infinity(), h); };
  for (std::int64_t row = 0; row < height; ++row) {
    const float* const from = &heights[static_cast<std::size_t>(row * width)];
    float* const to = &across[static_cast<std::size_t>(row * width)];
    std::int64_t i = 0;
    for (; i + 2 < width; ++i) to[i] = Larger(Larger(lowest(from[i]), from[i + 1]), from[i + 2]);
    for (; i < width; ++i) to[i] = i + 1 < width ? Larger(lowest(from[i]), from[i + 1]) : lowest(from[i]);
  }
  for (std::int64_t row = 0; row < height; ++row) {
    const float* const from = &across[static_cast<std::size_t>(row * width)];
    const float* const next = row + 1 < height ? from + width : from;
    const float* const last = row + 2 < height ? next + width : next;
    float* const to = &largest[static_cast<std::size_t>(row * width)];
    for (std::int64_t i = 0; i < width; ++i) to[i] = Larger(Larger(from[i], next[i]), last[i]);
  }
  return largest;
}

}  // namespace

SightBlock::SightBlock(const PointBlock& source, const std::vector<float>& undulations)
    : window_(source.window),
      heights_(source.Samples()),
      bridged_(source.smooth.empty() ? std::vector<float>() : source.Bridged()) {
  for (std::size_t i = 0; i < undulations.size(); ++i) heights_[i] += undulations[i];
  // A cell's samples are those of its corners; a raster of one column has cells without width.
  const std::int64_t width = window().columns, height = window().rows;
  largest_ = LargestOfThree(heights_, width, height);
  Level level{(width + 1) / 2, (height + 1) / 2, {}};
  level.cells.resize(static_cast<std::size_t>(level.columns * level.rows));
  for (std::int64_t row = 0; row < level.rows; ++row) {
    const float* const from = &largest_[static_cast<std::size_t>(2 * row * width)];
    CellsBound* const to = &level.cells[static_cast<std::size_t>(row * level.columns)];
    for (std::int64_t column = 0; column < level.columns; ++column) to[column].max = from[2 * column];
  }
  const auto has_voids = [](const std::vector<float>& heights) {
    bool has = false;
    for (const float h : heights) has |= std::isnan(h);
    return has;
  };
  for (const std::vector<float>* const heights : {&heights_, &bridged_}) {
    if (!has_voids(*heights)) continue;
    for (std::int64_t y = 0; y < height; ++y) {
      for (std::int64_t x = 0; x < width; ++x) {
        if (!std::isnan((*heights)[static_cast<std::size_t>(y * width + x)])) continue;
        // Cells on both sides have a sample between them.
        for (std::int64_t row = std::max<std::int64_t>(y - 1, 0) / 2; row <= y / 2; ++row) {
          for (std::int64_t column = std::max<std::int64_t>(x - 1, 0) / 2; column <= x / 2; ++column) {
            level.cells[static_cast<std::size_t>(row * level.columns + column)].has_voids = true;
          }
        }
      }
    }
  }
  levels_.push_back(std::move(level));
  while (levels_.back().columns > 1 || levels_.back().rows > 1) {
    const Level& fine = levels_.back();
    Level coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
    coarse.cells.resize(static_cast<std::size_t>(coarse.columns * coarse.rows));
    for (std::int64_t row = 0; row < fine.rows; ++row) {
      for (std::int64_t column = 0; column < fine.columns; ++column) {
        coarse.cells[static_cast<std::size_t>(row / 2 * coarse.columns + column / 2)].Add(
            fine.cells[static_cast<std::size_t>(row * fine.columns + column)]);
      }
    }
    levels_.push_back(std::move(coarse));
  }
  squares_of_4_ = SquaresOf(2);
  squares_of_8_ = SquaresOf(3);
}

SightBlock::Squares SightBlock::SquaresOf(int shift) const {
  // A small block has no level with cells of this size: its coarsest one is one cell.
  const Level& of = levels_[std::min(static_cast<std::size_t>(shift) - 1, levels_.size() - 1)];
  Squares squares{shift, of.columns, {}};
  squares.largest.reserve(of.cells.size());
  for (std::int64_t row = 0; row < of.rows; ++row) {
    const CellsBound* const here = &of.cells[static_cast<std::size_t>(row * of.columns)];
    const CellsBound* const below = row + 1 < of.rows ? here + of.columns : here;
    for (std::int64_t column = 0; column < of.columns; ++column) {
      const std::int64_t east = std::min(column + 1, of.columns - 1);
      squares.largest.push_back(
          std::max(std::max(here[column].max, here[east].max), std::max(below[column].max, below[east].max)));
    }
  }
  return squares;
}

CellsBound SightBlock::Over(std::int64_t west, std::int64_t north, std::int64_t east, std::int64_t south) const {
  west -= window().column, east -= window().column, north -= window().row, south -= window().row;
  const std::int64_t size = std::max(east - west, south - north) + 1;
  std::size_t level = 0;
  while ((std::int64_t{2} << level) < size && level + 1 < levels_.size()) ++level;
  const Level& of = levels_[level];
  CellsBound bound;
  const int shift = static_cast<int>(level) + 1;
  for (std::int64_t row = north >> shift; row <= std::min(south >> shift, of.rows - 1); ++row) {
    for (std::int64_t column = west >> shift; column <= std::min(east >> shift, of.columns - 1); ++column) {
      bound.Add(of.cells[static_cast<std::size_t>(row * of.columns + column)]);
    }
  }
  return bound;
}

SightBlocks::SightBlocks(const RasterGrid& grid) : grid_(grid), geoid_(grid.vertical().geoid) {
  if (geoid_ == nullptr) return;
  reader_ = std::make_unique<Geoid::Reader>(*geoid_);
  is_fine_ = std::max(grid.spacing().east, grid.spacing().north) <= kUndulationStep;
}

// Linear between positions at most kUndulationStep apart; at each sample where a line of the geoid's grid crosses the
// window, because undulations have a kink there.
Result<std::vector<float>> SightBlocks::UndulationsOf(const GridWindow& window) const {
  if (geoid_ == nullptr || !is_fine_) return std::vector<float>();
  const double spacing_m = std::max(grid_.spacing().east, grid_.spacing().north);
  auto step = std::max<std::int64_t>(1, static_cast<std::int64_t>(kUndulationStep / spacing_m));
  const auto count = [&](std::int64_t samples) { return (samples + step - 2) / step + 1; };
  const auto positions_of = [&] {
    std::vector<Position> positions;
    for (std::int64_t row = 0; row < count(window.rows); ++row) {
      for (std::int64_t column = 0; column < count(window.columns); ++column) {
        positions.push_back({static_cast<double>(window.column + column * step) + 0.5,
                             static_cast<double>(window.row + row * step) + 0.5});
      }
    }
    grid_.georeference().ToDegrees(positions);
    return positions;
  };
  std::vector<double> known;
  if (const UndulationGrid* const grid = geoid_->grid()) {
    std::vector<AxisPosition> x, y;
    const auto locate = [&] {
      x.clear(), y.clear();
      for (const Position& degrees : positions_of()) {
        x.push_back(grid->AtColumn(grid->ColumnOf(degrees.x)));
        y.push_back(grid->AtRow(grid->RowOf(degrees.y)));
      }
    };
    locate();
    const auto are_in_one_cell = [](const std::vector<AxisPosition>& places) {
      return std::ranges::all_of(places, [&](const AxisPosition& at) { return at.node == places.front().node; });
    };
    if (step > 1 && !(are_in_one_cell(x) && are_in_one_cell(y))) {
      step = 1;
      locate();
    }
    const auto patch = UndulationPatch::Read(*grid, x, y);
    if (!patch) return tl::unexpected(patch.error());
    for (std::size_t i = 0; i < x.size(); ++i) known.push_back(patch->At(x[i], y[i]));
  } else {
    for (const Position& degrees : positions_of()) known.push_back(reader_->At(degrees));
  }
  const std::int64_t columns = count(window.columns), rows = count(window.rows);
  std::vector<float> undulations;
  undulations.reserve(static_cast<std::size_t>(window.columns * window.rows));
  const auto stride = static_cast<std::size_t>(columns);
  for (std::int64_t row = 0; row < window.rows; ++row) {
    for (std::int64_t column = 0; column < window.columns; ++column) {
      const std::int64_t i = std::min(column / step, std::max<std::int64_t>(columns - 2, 0));
      const std::int64_t j = std::min(row / step, std::max<std::int64_t>(rows - 2, 0));
      const double x = static_cast<double>(column - i * step) / static_cast<double>(step);
      const double y = static_cast<double>(row - j * step) / static_cast<double>(step);
      const std::size_t at = static_cast<std::size_t>(j) * stride + static_cast<std::size_t>(i);
      const std::size_t east = columns > 1 ? 1 : 0, south = rows > 1 ? stride : 0;
      const double north = known[at] + x * (known[at + east] - known[at]);
      const double below = known[at + south] + x * (known[at + south + east] - known[at + south]);
      undulations.push_back(static_cast<float>(north + y * (below - north)));
    }
  }
  return undulations;
}

void SightBlocks::Trim() {
  if (blocks_.size() <= kMaxSightBlocks) return;
  blocks_.clear();
  last_ = -1;
  last_block_ = nullptr;
}

Result<const SightBlock*> SightBlocks::At(std::int64_t column, std::int64_t row, const std::stop_token& stop) {
  const std::int64_t block_column = (column + kPointBlockCells) / kPointBlockCells, block_row = row / kPointBlockCells;
  const std::int64_t number = block_row << 32 | block_column;
  if (number == last_) return last_block_;
  auto& block = blocks_[number];
  if (block == nullptr) {
    Result<PointBlockPtr> read = grid_.FindPointBlock(block_column, block_row, stop);
    if (!read) return tl::unexpected(std::move(read).error());
    const Result<std::vector<float>> undulations = UndulationsOf((*read)->window);
    if (!undulations) return tl::unexpected(undulations.error());
    block = std::make_unique<const SightBlock>(**read, *undulations);
  }
  last_ = number;
  return last_block_ = block.get();
}

}  // namespace terrace::dem

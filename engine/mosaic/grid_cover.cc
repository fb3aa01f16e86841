#include "engine/mosaic/grid_cover.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "engine/geo/tile_cover.h"
#include "engine/mosaic/window_values.h"

namespace terrace::dem {
namespace {

constexpr Box kNowhereBox{1e300, 1e300, -1e300, -1e300};

Box Grown(const Box& box, double by) { return {box.min_x - by, box.min_y - by, box.max_x + by, box.max_y + by}; }

bool Holds(const Box& box, const Position& p) {
  return (p.x >= box.min_x) & (p.x <= box.max_x) & (p.y >= box.min_y) & (p.y <= box.max_y);
}

}  // namespace

Box BoxOf(const PixelRange& pixels) {
  return {static_cast<double>(pixels.start_x), static_cast<double>(pixels.start_y),
          static_cast<double>(pixels.end_x + 1), static_cast<double>(pixels.end_y + 1)};
}

GridCover::GridCover(const std::vector<GridMember>& members, std::int64_t turn) {
  std::vector<PixelRange> ranges;
  for (const GridMember& member : members) {
    const PixelRange pixels = member.pixels();
    ranges.push_back(pixels);
    if (turn > 0 && pixels.end_x >= turn) {
      ranges.push_back({0, pixels.start_y, std::min(pixels.end_x, 2 * turn - 1) - turn, pixels.end_y});
    }
  }
  boxes_ = geo::Disjoint(std::move(ranges));
  std::vector<BoxIndex::Entry> entries;
  for (std::size_t i = 0; i < boxes_.size(); ++i) entries.push_back({BoxOf(boxes_[i]), i});
  index_ = BoxIndex(entries);
}

bool GridCover::Covers(const PixelRange& pixels) const {
  std::int64_t covered = 0;
  for (const std::size_t i : index_.Find(BoxOf(pixels))) covered += geo::Cells(geo::Intersection(boxes_[i], pixels));
  return covered == geo::Cells(pixels);
}

void GridCover::RemoveUncovered(int factor, std::int64_t blocks_of_turn, const GridWindow& window,
                                std::vector<float>& heights) const {
  std::vector<std::uint8_t> covered(heights.size());
  for (const std::int64_t turn : {0, -1, 1}) {
    if (turn != 0 && blocks_of_turn == 0) break;
    const GridWindow turned{window.column - turn * blocks_of_turn, window.row, window.columns, window.rows};
    const PixelRange wanted{turned.column, turned.row, turned.column + turned.columns - 1,
                            turned.row + turned.rows - 1};
    for (const std::size_t i : index_.Find(PixelsOf(turned, factor))) {
      const PixelRange& box = boxes_[i];
      const PixelRange blocks = geo::Intersection(
          {box.start_x / factor, box.start_y / factor, box.end_x / factor, box.end_y / factor}, wanted);
      if (geo::IsEmpty(blocks)) continue;
      if (blocks == wanted) return;
      for (std::int64_t row = blocks.start_y; row <= blocks.end_y; ++row) {
        const auto first = covered.begin() + static_cast<std::ptrdiff_t>(IndexIn(turned, blocks.start_x, row));
        std::fill_n(first, blocks.end_x - blocks.start_x + 1, std::uint8_t{1});
      }
    }
  }
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (covered[i] == 0) heights[i] = SampleRules::kVoid;
  }
}

std::vector<std::uint8_t> GridCover::Inside(const NodePositions& positions) const {
  return positions.is_separable() ? InsideOfAxes(positions) : Inside(positions.nodes(), positions.extent());
}

// A box contains one rectangle of nodes, or two if the columns jump by one turn.
std::vector<std::uint8_t> GridCover::InsideOfAxes(const NodePositions& positions) const {
  std::vector<std::uint8_t> inside(positions.columns() * positions.rows());
  Box extent = kNowhereBox;
  for (const double x : positions.x())
    extent.min_x = std::min(extent.min_x, x), extent.max_x = std::max(extent.max_x, x);
  for (const double y : positions.y())
    extent.min_y = std::min(extent.min_y, y), extent.max_y = std::max(extent.max_y, y);
  std::vector<std::uint8_t> columns(positions.columns());
  for (const std::size_t i : index_.Find(Grown(extent, 2 * kEdgeTolerance))) {
    const Box box = Grown(BoxOf(boxes_[i]), kEdgeTolerance);
    std::size_t first = columns.size(), end = 0;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const double x = positions.x()[c];
      columns[c] = x >= box.min_x && x <= box.max_x ? 1 : 0;
      if (columns[c] != 0) first = std::min(first, c), end = c + 1;
    }
    if (first >= end) continue;  // between two columns
    const bool is_one_run = std::find(columns.begin() + static_cast<std::ptrdiff_t>(first),
                                      columns.begin() + static_cast<std::ptrdiff_t>(end),
                                      0) == columns.begin() + static_cast<std::ptrdiff_t>(end);
    for (std::size_t j = 0; j < positions.rows(); ++j) {
      if (!(positions.y()[j] >= box.min_y && positions.y()[j] <= box.max_y)) continue;
      std::uint8_t* const row = inside.data() + j * columns.size();
      if (is_one_run) {
        std::fill(row + first, row + end, std::uint8_t{1});
        continue;
      }
      for (std::size_t c = first; c < end; ++c) row[c] |= columns[c];
    }
  }
  return inside;
}

std::vector<std::uint8_t> GridCover::Inside(std::span<const Position> positions) const {
  return Inside(positions, ExtentOf(positions));
}

std::vector<std::uint8_t> GridCover::Inside(std::span<const Position> positions, const PositionExtent& known) const {
  // Up to this number, each box is compared with all positions; for more, the index is used.
  constexpr std::size_t kFewBoxes = 8;
  std::vector<std::uint8_t> inside(positions.size());
  const Box extent{known.min.x, known.min.y, known.max.x, known.max.y};
  if (extent.min_x > extent.max_x) return inside;
  const auto box_of = [&](std::size_t i) { return Grown(BoxOf(boxes_[i]), kEdgeTolerance); };
  const std::vector<std::size_t> near = index_.Find(Grown(extent, 2 * kEdgeTolerance));
  if (near.size() <= kFewBoxes) {
    for (const std::size_t i : near) {
      const Box box = box_of(i);
      if (known.are_all_known && Holds(box, known.min) && Holds(box, known.max)) {
        std::ranges::fill(inside, std::uint8_t{1});
        return inside;
      }
      MarkInside(positions, {box.min_x, box.min_y}, {box.max_x, box.max_y}, inside);
    }
    return inside;
  }
  Box last = kNowhereBox;
  for (std::size_t n = 0; n < positions.size(); ++n) {
    const Position& p = positions[n];
    if (std::isnan(p.x) || std::isnan(p.y)) continue;
    inside[n] = Holds(last, p) ? 1 : 0;  // neighbours are usually in the same box
    if (inside[n] != 0) continue;
    for (const std::size_t i : index_.Find(Grown({p.x, p.y, p.x, p.y}, 2 * kEdgeTolerance))) {
      const Box box = box_of(i);
      if (!Holds(box, p)) continue;
      last = box;
      inside[n] = 1;
      break;
    }
  }
  return inside;
}

}  // namespace terrace::dem

// Reads heights at single points, at full resolution, with voids filled as in tiles. Points are read in the order of
// point blocks (point_blocks.h): those of one block share a read. Blocks that are wanted again are kept.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <tuple>
#include <utility>

#include "engine/mosaic/point_blocks.h"
#include "engine/mosaic/raster_grid.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {
namespace {

// From this number of points on, a block is read as a whole and kept.
constexpr std::size_t kManyPoints = 8;
// Points between two checks of the stop token.
constexpr std::size_t kBatch = 1024;

struct PointCell {
  std::size_t point;
  GridCell cell;
};

// Where columns wrap, a cell may lie one column west of the first.
std::int64_t BlockColumn(const GridCell& cell) { return (cell.column + kPointBlockCells) / kPointBlockCells; }
std::int64_t BlockRow(const GridCell& cell) { return cell.row / kPointBlockCells; }

// Sorts cells by block, by counting: rows of blocks first, points of a block in order.
std::vector<PointCell> InBlockOrder(std::vector<PointCell> cells) {
  std::int64_t west = BlockColumn(cells.front().cell), east = west, north = BlockRow(cells.front().cell), south = north;
  for (const PointCell& p : cells) {
    const std::int64_t column = BlockColumn(p.cell), row = BlockRow(p.cell);
    west = std::min(west, column), east = std::max(east, column);
    north = std::min(north, row), south = std::max(south, row);
  }
  if (west == east && north == south) return cells;
  const auto columns = static_cast<std::size_t>(east - west + 1), rows = static_cast<std::size_t>(south - north + 1);
  if (columns > (cells.size() + 1024) / rows) {
    std::ranges::sort(cells, {},
                      [](const PointCell& p) { return std::tuple(BlockRow(p.cell), BlockColumn(p.cell), p.point); });
    return cells;
  }
  const auto block_of = [&](const PointCell& p) {
    return static_cast<std::size_t>(BlockRow(p.cell) - north) * columns +
           static_cast<std::size_t>(BlockColumn(p.cell) - west);
  };
  std::vector<std::uint32_t> starts(columns * rows + 1);
  for (const PointCell& p : cells) ++starts[block_of(p) + 1];
  for (std::size_t i = 1; i < starts.size(); ++i) starts[i] += starts[i - 1];
  std::vector<PointCell> sorted(cells.size());
  for (const PointCell& p : cells) sorted[starts[block_of(p)]++] = p;
  return sorted;
}

// Converts from a source's vertical datum to the requested one.
class Conversion {
 public:
  static Result<Conversion> For(const VerticalDatum& source, HeightDatum wanted) {
    Conversion conversion;
    if (wanted == HeightDatum::kEllipsoid && source.geoid) {
      conversion.geoid_ = source.geoid;
      conversion.sign_ = 1;
    } else if (wanted == HeightDatum::kOrthometric && source.is_known() && !source.geoid) {
      auto egm96 = Geoid::OfCrs("EPSG:5773", {0, 0});
      if (!egm96) return tl::unexpected(egm96.error());
      conversion.geoid_ = *std::move(egm96);
      conversion.sign_ = -1;
    }
    if (conversion.geoid_) conversion.reader_ = std::make_unique<Geoid::Reader>(*conversion.geoid_);
    return conversion;
  }

  // NaN if the geoid is not known.
  double Of(double height, const GeoPosition& point) const {
    return reader_ ? height + sign_ * reader_->At({point.longitude, point.latitude}) : height;
  }

 private:
  std::shared_ptr<const Geoid> geoid_;  // null: none needed
  std::unique_ptr<Geoid::Reader> reader_;
  double sign_ = 0;
};

}  // namespace

std::uint64_t RasterGrid::NextId() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

Result<PointBlock> RasterGrid::ReadPointBlock(const GridWindow& window, const std::stop_token& stop) const {
  PointBlock block{window, {}, {}, {}, {}, {}};
  auto bridged = ReadBridged(1, window, stop, &block.measured);
  if (!bridged) return tl::unexpected(bridged.error());
  auto smoothed = FillHoles(1, window, *bridged, stop);
  if (!smoothed) return tl::unexpected(smoothed.error());
  block.bridged = std::move(bridged->heights);
  block.smooth = *std::move(smoothed);
  return block;
}

// The samples of all cells of a block.
GridWindow RasterGrid::WindowOfPointBlock(std::int64_t block_column, std::int64_t block_row) const {
  const std::int64_t first = (block_column - 1) * kPointBlockCells, top = block_row * kPointBlockCells;
  const std::int64_t west = std::max<std::int64_t>(first, wraps_ ? -1 : 0);
  const std::int64_t east = std::min<std::int64_t>(first + kPointBlockCells, wraps_ ? columns_ : columns_ - 1);
  const std::int64_t south = std::min<std::int64_t>(top + kPointBlockCells, height_ - 1);
  return {west, top, east - west + 1, south - top + 1};
}

Result<PointBlockPtr> RasterGrid::FindPointBlock(std::int64_t block_column, std::int64_t block_row,
                                                 const std::stop_token& stop) const {
  const PointBlockKey key{id_, block_column, block_row};
  PointBlockCache& cache = PointBlockCache::Shared();
  if (PointBlockPtr known = cache.Find(key)) return known;
  auto read = ReadPointBlock(WindowOfPointBlock(block_column, block_row), stop);
  if (!read) return tl::unexpected(read.error());
  read->Compact();
  auto block = std::make_shared<const PointBlock>(*std::move(read));
  cache.Insert(key, block);
  return PointBlockPtr(block);
}

// The block of some cells: a kept one, or one that is read and kept. For few points of a block that was not requested
// lately: only a window around them. It may lie in several turns around the Earth; then the cells are moved into one.
Result<PointBlockPtr> RasterGrid::BlockOfCells(std::vector<GridCell>& cells, const std::stop_token& stop) const {
  const std::int64_t column = BlockColumn(cells.front()), row = BlockRow(cells.front());
  const PointBlockKey key{id_, column, row};
  if (PointBlockPtr known = PointBlockCache::Shared().Find(key)) return known;
  if (PointBlockCache::Shared().Note(key) || cells.size() >= kManyPoints) return FindPointBlock(column, row, stop);
  auto read = ReadPointBlock(MoveTogether(cells, Axes(1)), stop);
  if (!read) return tl::unexpected(read.error());
  return std::make_shared<const PointBlock>(*std::move(read));
}

Result<void> RasterGrid::FillPoints(std::span<const GeoPosition> points, HeightDatum datum, const NodeHeights& nodes,
                                    std::span<std::uint8_t> filled, const std::stop_token& stop) const {
  const std::span<float> heights = nodes.heights;
  const auto converted = Conversion::For(vertical(), datum);
  if (!converted) return tl::unexpected(converted.error());
  const GridAxes axes = Axes(1);
  std::vector<PointCell> found;
  found.reserve(points.size());
  std::vector<Position> batch;
  for (std::size_t done = 0; done < points.size(); done += batch.size()) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading points was stopped");
    batch.clear();
    for (const GeoPosition& point : points.subspan(done, std::min(kBatch, points.size() - done))) {
      batch.push_back({point.longitude, point.latitude});
    }
    georeference_.ToPixels(batch);
    const std::vector<std::uint8_t> inside = cover_.Inside(batch);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      if (!std::isnan(heights[done + i])) continue;
      // A pole has one height at all longitudes, as in tiles.
      const double latitude = points[done + i].latitude;
      if (const auto& pole = pole_heights_[latitude < 0 ? 0 : 1]; pole && std::abs(latitude) == 90) {
        heights[done + i] = RoundHeight(converted->Of(*pole, {0, latitude}));
        continue;
      }
      if (inside[i] == 0) continue;
      found.push_back({done + i, axes.CellAt(batch[i])});
    }
  }
  // Blocks that are kept are of the file as it was.
  if (const auto unchanged = CheckUnchanged(); !unchanged || found.empty()) return unchanged;
  found = InBlockOrder(std::move(found));

  std::vector<GridCell> cells;
  for (auto first = found.begin(); first != found.end();) {
    const std::int64_t column = BlockColumn(first->cell), row = BlockRow(first->cell);
    cells.clear();
    for (auto p = first; p != found.end() && BlockColumn(p->cell) == column && BlockRow(p->cell) == row; ++p) {
      cells.push_back(p->cell);
    }
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading points was stopped");
    const auto read = BlockOfCells(cells, stop);
    if (!read) return tl::unexpected(read.error());
    const PointBlock& block = **read;
    for (const GridCell& cell : cells) {
      const std::size_t point = (first++)->point;
      const auto height = block.HeightAt(cell);
      if (!height) continue;
      const float rounded = RoundHeight(converted->Of(*height, points[point]));
      const bool is_in_hole = block.has_voids() && !HasSample(block.bridged, block.window, cell);
      (is_in_hole ? (*nodes.hole_heights)[point] : heights[point]) = rounded;
      const bool is_filled = block.has_voids() && (is_in_hole || !IsNearestValid(block.measured, block.window, cell));
      filled[point] = is_filled ? 1 : 0;
    }
  }
  return {};
}

}  // namespace terrace::dem

// Heights at single points, as measured. Points are read in the order of the source's blocks, whatever order they came
// in: neighbours share a read, and no block is decoded twice because others were wanted in between.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "engine/dem/grid_cells.h"
#include "engine/dem/sheet.h"

namespace terrace::dem {
namespace {

// Samples per axis that are read at once.
constexpr std::int64_t kBlock = 256;
// Points between two looks at whether anybody still waits.
constexpr std::size_t kBatch = 1024;

struct PointCell {
  std::size_t point;
  std::int64_t block_column, block_row;
  GridCell cell;
};

}  // namespace

Result<void> Sheet::FillPoints(std::span<const GeoPosition> points, std::span<float> heights,
                               const std::stop_token& stop) const {
  const GridAxis columns = Columns(1), rows = Rows(1);
  std::vector<PointCell> found;
  std::vector<Position> batch;
  for (std::size_t done = 0; done < points.size(); done += batch.size()) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading points was stopped");
    batch.clear();
    for (const GeoPosition& point : points.subspan(done, std::min(kBatch, points.size() - done))) {
      batch.push_back({point.longitude, point.latitude});
    }
    georeference_.ToPixels(batch);
    const Cells here = CellsAt(batch, heights.subspan(done, batch.size()), 1);
    for (std::size_t i = 0; i < here.cells.size(); ++i) {
      const GridCell& cell = here.cells[i];
      found.push_back({done + here.nodes[i], (cell.column + kBlock) / kBlock, cell.row / kBlock, cell});
    }
  }
  if (found.empty()) return CheckUnread();
  std::ranges::sort(found, {}, [](const PointCell& p) { return std::tuple(p.block_row, p.block_column, p.point); });

  std::vector<GridCell> cells;
  for (auto first = found.begin(); first != found.end();) {
    const auto end = std::find_if(first, found.end(), [&](const PointCell& p) {
      return p.block_column != first->block_column || p.block_row != first->block_row;
    });
    cells.clear();
    for (auto p = first; p != end; ++p) cells.push_back(p->cell);
    const GridWindow window = WindowOf(cells, columns, rows);
    const auto samples = ReadBlocks(1, window, stop);
    if (!samples) return tl::unexpected(samples.error());
    for (std::size_t i = 0; first != end; ++first, ++i) {
      if (!IsNearestValid(*samples, window, cells[i])) continue;
      if (const auto height = Interpolate(*samples, window, cells[i])) heights[first->point] = RoundHeight(*height);
    }
  }
  return {};
}

}  // namespace terrace::dem

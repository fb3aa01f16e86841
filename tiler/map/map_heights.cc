#include "tiler/map/map_heights.h"

#include <algorithm>
#include <limits>

#include "engine/geo/mercator_grid.h"

namespace terrace::tiler {

// A tile of 512 pixels has the pixels of the four tiles of 256 below it.
MapWindow::MapWindow(const geo::TileKey& key, int size_of_tile, int margin_of_tile)
    : depth(key.level + (size_of_tile == 512 ? 1 : 0)),
      size(size_of_tile),
      margin(margin_of_tile),
      first_row(key.y * size - margin) {
  const std::int64_t north = std::max<std::int64_t>(first_row, 0);
  const std::int64_t south = std::min((key.y + 1) * size + margin, geo::MercatorGrid{depth}.rows());
  nodes = {key.x * size - margin, north, size + 2 * margin, static_cast<int>(south - north)};
}

Result<MapHeights> ReadMapHeights(const dem::ElevationModel& model, const MapWindow& window, dem::HeightDatum datum,
                                  const std::stop_token& stop) {
  if (window.depth > model.info().max_mercator_depth) return MakeError(ErrorCode::kNotFound, "no such tile");
  auto read = model.ReadKnownMercator(window.depth, window.nodes, datum, stop);
  if (!read) return tl::unexpected(read.error());
  MapHeights map;
  map.side = window.size + 2 * window.margin;
  map.heights.assign(dem::Area(map.side, map.side), std::numeric_limits<float>::quiet_NaN());
  const std::int64_t rows_before = window.nodes.row - window.first_row;
  std::ranges::copy(*read, map.heights.begin() + static_cast<std::ptrdiff_t>(rows_before * map.side));
  return map;
}

}  // namespace terrace::tiler

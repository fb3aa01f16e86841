// Heights of a map tile and of a margin around it, so that slopes and lines continue across the tile's edges.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "engine/geo/tile_key.h"

namespace terrace::tiler {

// The pixels of a Web Mercator tile with a margin, without rows beyond the ends of the square.
struct MapWindow {
  MapWindow(const geo::TileKey& key, int size, int margin);

  int depth;  // of the geo::MercatorGrid
  int size, margin;
  std::int64_t first_row;  // of the margin, also if it is negative
  dem::NodeWindow nodes;
};

// Row by row from the north-western pixel of the margin; NaN where there is no height. `side` = size + 2 * margin.
struct MapHeights {
  int side = 0;
  std::vector<float> heights;

  float At(int column, int row) const {
    return heights[static_cast<std::size_t>(row) * static_cast<std::size_t>(side) + static_cast<std::size_t>(column)];
  }
};

// Errors: those of ElevationModel::ReadKnownMercator, and kNotFound: deeper than the dataset's max_mercator_depth.
Result<MapHeights> ReadMapHeights(const dem::ElevationModel& model, const MapWindow& window, dem::HeightDatum datum,
                                  const std::stop_token& stop);

}  // namespace terrace::tiler

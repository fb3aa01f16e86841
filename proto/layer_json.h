// layer.json: what CesiumJS, cesium-native and 3DTilesRendererJS read before the first tile.
#pragma once

#include <string>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::proto {

struct LayerDescription {
  std::string name;
  std::string attribution;
  std::string version = "1.0.0";
  std::vector<std::vector<geo::TileRange>> available;  // by level, from 0
  // Degrees. west > east, or east > 180, is a box across the antimeridian: layer.json then spans all longitudes,
  // because its readers know only boxes with west < east.
  double west = -180, south = -90, east = 180, north = 90;
  std::string tile_query;  // appended to the tile template, without '?': "error=5&atleast=1"; may be empty
};

// UTF-8 JSON. The metadata extension (availability inside tiles) is never offered, so `available` must be complete:
// from both roots down, every ancestor of an available tile included. Precondition: available is not empty.
std::string EncodeLayerJson(const LayerDescription& layer);

}  // namespace terrace::proto

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
  double west = -180, south = -90, east = 180, north = 90;
  std::string tile_query;  // appended to the tile template, without '?': "error=5&atleast=1"; may be empty
};

std::string EncodeLayerJson(const LayerDescription& layer);

}  // namespace terrace::proto

// layer.json: what CesiumJS, cesium-native and 3DTilesRendererJS read before the first tile.
#pragma once

#include <stop_token>
#include <string>
#include <vector>

#include "engine/geo/geo_bounds.h"
#include "engine/geo/tile_key.h"

namespace terrace::proto {

struct LayerDescription {
  std::string name;
  std::string attribution;
  std::string version;                                 // of the tiles, for the template: [0-9A-Za-z._~-]
  std::vector<std::vector<geo::TileRange>> available;  // by level, from 0
  // Degrees. west > east, or east > 180, is a box across the antimeridian: layer.json then spans all longitudes,
  // because its readers know only boxes with west < east.
  geo::GeoBounds bounds;
  bool normals = true;            // tiles have them on request
  bool water_mask = false;        // tiles have it on request
  int metadata_availability = 0;  // tiles at multiples of this level have metadata on request; 0: none
  std::string tile_query;         // appended to the tile template's query: "error=5&atleast=1"; may be empty
};

// UTF-8 JSON; empty if a stop was requested. `available` must be complete: it contains both roots and every ancestor of
// an available tile. It is written for any `metadata_availability`: CesiumJS and cesium-native ignore it if tiles have
// metadata, and other clients read nothing else. Precondition: available is not empty.
std::string EncodeLayerJson(const LayerDescription& layer, const std::stop_token& stop = {});

}  // namespace terrace::proto

// TileJSON 3.0: what MapLibre, Mapbox, QGIS and others read before the first tile of a raster-dem source.
#pragma once

#include <string>

#include "proto/documents/height_png.h"

namespace terrace::proto {

struct TileJsonDescription {
  std::string name;
  std::string attribution;
  std::string tile_template;  // an absolute URL with {z}, {x} and {y}: clients do not resolve it against the TileJSON's
  int max_zoom = 0;
  int tile_size = 256;
  HeightEncoding encoding = HeightEncoding::kMapbox;
  // Degrees. west > east is a box across the antimeridian: TileJSON forbids that, and has all longitudes then.
  double west = -180, south = -90, east = 180, north = 90;
};

// UTF-8 JSON. Latitudes are clipped to Web Mercator's.
std::string EncodeTileJson(const TileJsonDescription& tiles);

// "mapbox", "terrarium": as in URLs and in TileJSON.
const char* ToString(HeightEncoding encoding);

}  // namespace terrace::proto

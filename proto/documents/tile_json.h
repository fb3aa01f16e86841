// TileJSON 3.0: what MapLibre, Mapbox, QGIS and others read before the first tile of a source.
#pragma once

#include <cstdint>
#include <string>

#include "engine/geo/geo_bounds.h"
#include "proto/documents/picture_types.h"

namespace terrace::proto {

// The type of a source. kHeights: "raster-dem"; kPictures: "raster"; kContours: "vector" (vector_tile.h).
enum class TileJsonKind : std::uint8_t { kHeights, kPictures, kContours };

struct TileJsonDescription {
  TileJsonKind kind = TileJsonKind::kHeights;
  std::string format = "png";  // "pbf" for contours
  std::string name;
  std::string attribution;
  std::string tile_template;  // an absolute URL with {z}, {x} and {y}: clients do not resolve it against the TileJSON's
  int min_zoom = 0, max_zoom = 0;
  int tile_size = 256;
  HeightEncoding encoding = HeightEncoding::kMapbox;
  geo::GeoBounds bounds;  // TileJSON forbids boxes across the antimeridian: its box then spans all longitudes
};

// UTF-8 JSON. Latitudes are clipped to Web Mercator's.
std::string EncodeTileJson(const TileJsonDescription& tiles);

}  // namespace terrace::proto

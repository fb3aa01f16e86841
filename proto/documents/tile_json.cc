#include "proto/documents/tile_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/core/names.h"
#include "engine/geo/mercator_grid.h"
#include "proto/documents/picture_names.h"
#include "proto/documents/vector_tile.h"

namespace terrace::proto {

std::string EncodeTileJson(const TileJsonDescription& tiles) {
  using Json = nlohmann::ordered_json;
  const bool crosses_antimeridian = tiles.bounds.west > tiles.bounds.east;
  const auto clipped = [](double latitude) {
    return std::clamp(latitude, -geo::kMercatorLatitude, geo::kMercatorLatitude);
  };
  Json json;
  json["tilejson"] = "3.0.0";
  json["name"] = tiles.name;
  json["scheme"] = "xyz";
  json["tiles"] = Json::array({tiles.tile_template});
  json["minzoom"] = tiles.min_zoom;
  json["maxzoom"] = tiles.max_zoom;
  json["bounds"] = Json::array({crosses_antimeridian ? -180 : tiles.bounds.west, clipped(tiles.bounds.south),
                                crosses_antimeridian ? 180 : tiles.bounds.east, clipped(tiles.bounds.north)});
  json["attribution"] = tiles.attribution;
  json["type"] = tiles.kind == TileJsonKind::kHeights    ? "raster-dem"
                 : tiles.kind == TileJsonKind::kPictures ? "raster"
                                                         : "vector";
  json["format"] = tiles.format;
  if (tiles.kind == TileJsonKind::kHeights) json["encoding"] = NameIn(kHeightEncodingNames, tiles.encoding);
  if (tiles.kind == TileJsonKind::kContours) {
    json["vector_layers"] = Json::array({{{"id", kContourLayer},
                                          {"description", "lines of equal height"},
                                          {"minzoom", tiles.min_zoom},
                                          {"maxzoom", tiles.max_zoom},
                                          {"fields", {{"ele", "Number"}, {"index", "Boolean"}}}}});
  } else {
    json["tileSize"] = tiles.tile_size;
  }
  // Names and attributions come from files: bytes that are not UTF-8 become U+FFFD instead of an exception.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace terrace::proto

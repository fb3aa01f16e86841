#include "proto/layer_json.h"

#include <nlohmann/json.hpp>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

Json Available(const std::vector<std::vector<geo::TileRange>>& levels) {
  Json json = Json::array();
  for (const std::vector<geo::TileRange>& ranges : levels) {
    Json level = Json::array();
    for (const geo::TileRange& range : ranges) {
      level.push_back(
          {{"startX", range.start_x}, {"startY", range.start_y}, {"endX", range.end_x}, {"endY", range.end_y}});
    }
    json.push_back(std::move(level));
  }
  return json;
}

Json Bounds(const LayerDescription& layer) {
  const bool crosses_antimeridian = layer.west > layer.east || layer.east > 180 || layer.west < -180;
  if (crosses_antimeridian) return Json::array({-180, layer.south, 180, layer.north});
  return Json::array({layer.west, layer.south, layer.east, layer.north});
}

}  // namespace

std::string EncodeLayerJson(const LayerDescription& layer) {
  TERRACE_CHECK(!layer.available.empty());
  // One template only: cesium-native and 3DTilesRendererJS read no other than the first.
  std::string tile_template = "{z}/{x}/{y}.terrain?v={version}";
  if (!layer.tile_query.empty()) tile_template += "&" + layer.tile_query;

  Json json;
  json["tilejson"] = "2.1.0";
  json["name"] = layer.name;
  json["format"] = "quantized-mesh-1.0";
  json["version"] = layer.version;
  json["scheme"] = "tms";
  json["projection"] = "EPSG:4326";
  json["tiles"] = Json::array({tile_template});
  json["minzoom"] = 0;
  json["maxzoom"] = layer.available.size() - 1;
  json["bounds"] = Bounds(layer);
  json["attribution"] = layer.attribution;
  json["extensions"] = Json::array({"octvertexnormals"});
  if (layer.water_mask) json["extensions"].push_back("watermask");
  if (layer.metadata_levels > 0) {
    json["extensions"].push_back("metadata");
    json["metadataAvailability"] = layer.metadata_levels;
  }
  json["available"] = Available(layer.available);
  // Names and attributions come from files: bytes that are not UTF-8 become U+FFFD instead of an exception.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace terrace::proto

#include "proto/documents/layer_json.h"

#include <fmt/format.h>

#include <cstddef>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

// Ranges between two checks of the stop token: about a tenth of a millisecond.
constexpr std::size_t kStopPeriod = 1024;

// A mosaic of scattered sources has megabytes of ranges, so they are written directly, without a JSON tree. Returns
// false if a stop was requested.
bool AppendAvailable(const std::vector<std::vector<geo::TileRange>>& levels, const std::stop_token& stop,
                     std::string& json) {
  std::size_t count = 0;
  const char* before_level = "[";
  for (const std::vector<geo::TileRange>& ranges : levels) {
    json.append(std::exchange(before_level, ",")).append("[");
    const char* before = "";
    for (const geo::TileRange& range : ranges) {
      if (count++ % kStopPeriod == 0 && stop.stop_requested()) return false;
      fmt::format_to(std::back_inserter(json), R"({}{{"startX":{},"startY":{},"endX":{},"endY":{}}})",
                     std::exchange(before, ","), range.start_x, range.start_y, range.end_x, range.end_y);
    }
    json += ']';
  }
  json += ']';
  return true;
}

Json Bounds(const geo::GeoBounds& box) {
  const bool crosses_antimeridian = box.west > box.east || box.east > 180 || box.west < -180;
  if (crosses_antimeridian) return Json::array({-180, box.south, 180, box.north});
  return Json::array({box.west, box.south, box.east, box.north});
}

}  // namespace

std::string EncodeLayerJson(const LayerDescription& layer, const std::stop_token& stop) {
  TERRACE_CHECK(!layer.available.empty());
  // Only one template: cesium-native and 3DTilesRendererJS use only the first. The version stands in it as it is:
  // 3DTilesRendererJS writes 1 for {version}.
  std::string tile_template = "{z}/{x}/{y}.terrain?v=" + layer.version;
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
  json["bounds"] = Bounds(layer.bounds);
  json["attribution"] = layer.attribution;
  json["extensions"] = Json::array();
  if (layer.normals) json["extensions"].push_back("octvertexnormals");
  if (layer.water_mask) json["extensions"].push_back("watermask");
  if (layer.metadata_availability > 0) {
    json["extensions"].push_back("metadata");
    json["metadataAvailability"] = layer.metadata_availability;
  }
  // Names and attributions come from files: bytes that are not UTF-8 become U+FFFD instead of an exception.
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.back() = ',';  // replaces the end of the object
  text += R"("available":)";
  if (!AppendAvailable(layer.available, stop, text)) return {};
  return text + '}';
}

}  // namespace terrace::proto

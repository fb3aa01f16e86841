#include "proto/documents/layer_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace terrace::proto {
namespace {

using Json = nlohmann::json;

LayerDescription Maui() {
  LayerDescription layer;
  layer.name = "maui";
  layer.attribution = "© a \"survey\"";
  layer.version = "7";
  layer.available = {{{0, 0, 1, 0}}, {{0, 1, 0, 1}, {1, 1, 2, 1}}};
  layer.bounds = {-156.75, 20.5, -155.9, 21.1};
  return layer;
}

TEST(LayerJson, HasWhatClientsRequire) {
  const Json json = Json::parse(EncodeLayerJson(Maui()));
  EXPECT_EQ(json.at("tilejson"), "2.1.0");
  EXPECT_EQ(json.at("name"), "maui");
  EXPECT_EQ(json.at("attribution"), "© a \"survey\"");
  EXPECT_EQ(json.at("format"), "quantized-mesh-1.0");
  EXPECT_EQ(json.at("version"), "7");
  EXPECT_EQ(json.at("scheme"), "tms");
  EXPECT_EQ(json.at("projection"), "EPSG:4326");
  EXPECT_EQ(json.at("minzoom"), 0);
  EXPECT_EQ(json.at("maxzoom"), 1);
  EXPECT_EQ(json.at("bounds"), Json::array({-156.75, 20.5, -155.9, 21.1}));
  EXPECT_EQ(json.at("extensions"), Json::array({"octvertexnormals"}));
  EXPECT_FALSE(json.contains("metadataAvailability"));
}

TEST(LayerJson, ListsEveryRangeOfEveryLevel) {
  const Json expected = Json::parse(R"([[{"startX":0,"startY":0,"endX":1,"endY":0}],
      [{"startX":0,"startY":1,"endX":0,"endY":1},{"startX":1,"startY":1,"endX":2,"endY":1}]])");
  EXPECT_EQ(Json::parse(EncodeLayerJson(Maui())).at("available"), expected);
}

TEST(LayerJson, NamesTheExtensionsThatTilesHave) {
  LayerDescription layer = Maui();
  layer.water_mask = true;
  Json json = Json::parse(EncodeLayerJson(layer));
  EXPECT_EQ(json.at("extensions"), Json::array({"octvertexnormals", "watermask"}));
  EXPECT_FALSE(json.contains("metadataAvailability"));
  layer.metadata_availability = 4;
  json = Json::parse(EncodeLayerJson(layer));
  EXPECT_EQ(json.at("extensions"), Json::array({"octvertexnormals", "watermask", "metadata"}));
  EXPECT_EQ(json.at("metadataAvailability"), 4);
  EXPECT_EQ(json.at("available").size(), 2u) << "for clients that read no metadata";
}

TEST(LayerJson, OneTemplateCarriesVersionAndQuery) {
  LayerDescription layer = Maui();
  EXPECT_EQ(Json::parse(EncodeLayerJson(layer)).at("tiles"), Json::array({"{z}/{x}/{y}.terrain?v=7"}));
  layer.tile_query = "error=5&atleast=1";
  EXPECT_EQ(Json::parse(EncodeLayerJson(layer)).at("tiles"),
            Json::array({"{z}/{x}/{y}.terrain?v=7&error=5&atleast=1"}));
}

TEST(LayerJson, BoxAcrossTheAntimeridianSpansAllLongitudes) {
  for (const auto& [west, east] : {std::pair{177.0, -178.0}, {177.0, 182.0}, {-183.0, -178.0}}) {
    LayerDescription layer = Maui();
    layer.bounds.west = west;
    layer.bounds.east = east;
    EXPECT_EQ(Json::parse(EncodeLayerJson(layer)).at("bounds"), Json::array({-180, 20.5, 180, 21.1}));
  }
}

TEST(LayerJson, BytesThatAreNotUtf8DoNotStopIt) {
  LayerDescription layer = Maui();
  layer.attribution = "Universit\xe9";  // Latin-1
  EXPECT_EQ(Json::parse(EncodeLayerJson(layer)).at("attribution"), "Universit\xef\xbf\xbd");
}

}  // namespace
}  // namespace terrace::proto

#include "proto/documents/tile_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace terrace::proto {
namespace {

TEST(TileJson, SaysWhatARasterDemSourceReads) {
  TileJsonDescription tiles;
  tiles.name = "alps";
  tiles.attribution = "NASA \"SRTM\"";
  tiles.tile_template = "http://example.test/alps/{z}/{x}/{y}.png?size=512";
  tiles.max_zoom = 11;
  tiles.tile_size = 512;
  tiles.encoding = HeightEncoding::kTerrarium;
  tiles.bounds = {8, 46, 9, 47};
  const auto json = nlohmann::json::parse(EncodeTileJson(tiles));
  EXPECT_EQ(json["tilejson"], "3.0.0");
  EXPECT_EQ(json["scheme"], "xyz");
  EXPECT_EQ(json["tiles"], nlohmann::json::array({tiles.tile_template}));
  EXPECT_EQ(json["minzoom"], 0);
  EXPECT_EQ(json["maxzoom"], 11);
  EXPECT_EQ(json["tileSize"], 512);
  EXPECT_EQ(json["encoding"], "terrarium");
  EXPECT_EQ(json["bounds"], nlohmann::json::parse("[8.0, 46.0, 9.0, 47.0]"));
  EXPECT_EQ(json["attribution"], "NASA \"SRTM\"");
}

TEST(TileJson, BoundsStayInsideTheSquareOfTheMap) {
  TileJsonDescription tiles;
  EXPECT_EQ(nlohmann::json::parse(EncodeTileJson(tiles))["bounds"],
            nlohmann::json::parse("[-180.0, -85.0511287798066, 180.0, 85.0511287798066]"));
  tiles.bounds.west = 170;
  tiles.bounds.east = -160;
  const auto bounds = nlohmann::json::parse(EncodeTileJson(tiles))["bounds"];
  EXPECT_EQ(bounds[0], -180);
  EXPECT_EQ(bounds[2], 180);
}

TEST(TileJson, SurvivesTextThatIsNotUtf8) {
  TileJsonDescription tiles;
  tiles.attribution = "caf\xe9";
  EXPECT_EQ(nlohmann::json::parse(EncodeTileJson(tiles))["attribution"], "caf\xef\xbf\xbd");
}

}  // namespace
}  // namespace terrace::proto

#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>
#include <string>

#include "server/handlers/handlers.h"
#include "tests/server/handlers/at_once.h"

namespace terrace::server {
namespace {

class TileJsonHandlerTest : public testing::Test {
 protected:
  TileJsonHandlerTest() {
    datasets_[0].name = "a b";
    datasets_[0].generation = 0x0a1b2c3d4e5f6789;
    datasets_[0].available = {{{0, 0, 1, 0}}};
    datasets_[0].max_mercator_depth = 12;
  }
  Response Get(const char* target, const char* host = "example.test:8080", bool is_https = false) {
    Request request;
    request.fields.Set(&RequestFields::host, host);
    request.is_https = is_https;
    const TestHandlerState state(datasets_);
    return std::get<Response>(AnswerTileJson(state.all, TestContext(target, request).context));
  }
  Response GetMap(const char* target) {
    Request request;
    request.fields.Set(&RequestFields::host, "h");
    const TestHandlerState state(datasets_);
    return std::get<Response>(AnswerMapTileJson(state.all, TestContext(target, request).context));
  }
  static nlohmann::json Parse(const Response& response) { return nlohmann::json::parse(*response.body); }

  std::vector<DatasetView> datasets_{1};
};

TEST_F(TileJsonHandlerTest, NamesTilesAsTheClientCanAskForThem) {
  const Response response = Get("/a%20b/tiles.json");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.content_type, "application/json");
  EXPECT_EQ(response.cache_control, "no-cache");
  EXPECT_EQ(Parse(response)["tiles"][0], "http://example.test:8080/a%20b/{z}/{x}/{y}.png?v=0a1b2c3d4e5f");
  EXPECT_EQ(Parse(response)["maxzoom"], 12);
  EXPECT_EQ(Parse(Get("/a%20b/tiles.json", ""))["tiles"][0], "/a%20b/{z}/{x}/{y}.png?v=0a1b2c3d4e5f");
  EXPECT_EQ(Parse(Get("/a%20b/tiles.json", "h", true))["tiles"][0], "https://h/a%20b/{z}/{x}/{y}.png?v=0a1b2c3d4e5f");
  EXPECT_EQ(response.vary_more, "Forwarded");
}

TEST_F(TileJsonHandlerTest, PromisesTheTilesOfAnArchiveAlone) {
  EXPECT_EQ(Parse(Get("/a%20b/tiles.json"))["minzoom"], 0);
  datasets_[0].min_mercator_depth = 4;
  datasets_[0].height_tile_bounds = {1, 2, 3, 4};
  const auto json = Parse(Get("/a%20b/tiles.json"));
  EXPECT_EQ(json["minzoom"], 4);
  EXPECT_EQ(json["bounds"], nlohmann::json({1.0, 2.0, 3.0, 4.0}));
}

TEST_F(TileJsonHandlerTest, WritesParametersIntoTheTemplate) {
  const auto json = Parse(Get("/a%20b/tiles.json?size=512&encoding=terrarium&v=3"));
  EXPECT_EQ(json["tiles"][0],
            "http://example.test:8080/a%20b/{z}/{x}/{y}.png?v=0a1b2c3d4e5f&encoding=terrarium&size=512");
  EXPECT_EQ(json["maxzoom"], 11);
  EXPECT_EQ(json["tileSize"], 512);
  EXPECT_EQ(json["encoding"], "terrarium");
  EXPECT_EQ(Parse(Get("/a%20b/tiles.json?size=256&encoding=mapbox"))["tiles"][0],
            "http://example.test:8080/a%20b/{z}/{x}/{y}.png?v=0a1b2c3d4e5f");
}

TEST_F(TileJsonHandlerTest, DescribesLayersForMaps) {
  auto json = Parse(GetMap("/a%20b/hillshade/tiles.json?altitude=30&zfactor=2.5"));
  EXPECT_EQ(json["tiles"][0], "http://h/a%20b/hillshade/{z}/{x}/{y}.png?v=0a1b2c3d4e5f&altitude=30&zfactor=2.5");
  EXPECT_EQ(json["type"], "raster");
  EXPECT_FALSE(json.contains("encoding"));
  json = Parse(GetMap("/a%20b/slope/tiles.json?format=webp&style=degrees&size=512"));
  EXPECT_EQ(json["tiles"][0], "http://h/a%20b/slope/{z}/{x}/{y}.webp?v=0a1b2c3d4e5f&style=degrees&size=512");
  EXPECT_EQ(json["format"], "webp");
  EXPECT_EQ(json["maxzoom"], 11);
  json = Parse(GetMap("/a%20b/contours/tiles.json?interval=12.5"));
  EXPECT_EQ(json["tiles"][0], "http://h/a%20b/contours/{z}/{x}/{y}.mvt?v=0a1b2c3d4e5f&interval=12.5");
  EXPECT_EQ(json["vector_layers"][0]["id"], "contour");
  EXPECT_EQ(json["type"], "vector");
  EXPECT_EQ(GetMap("/a%20b/imagery/tiles.json").status, 404);
  datasets_[0].imagery = dem::ImageExtent{{1, 2, 3, 4}, 9, 8};
  datasets_[0].imagery_attribution = "A. Pilot";
  json = Parse(GetMap("/a%20b/imagery/tiles.json?format=jpg"));
  EXPECT_EQ(json["tiles"][0], "http://h/a%20b/imagery/{z}/{x}/{y}.jpg?v=0a1b2c3d4e5f");
  EXPECT_EQ(json["bounds"], nlohmann::json({1, 2, 3, 4}));
  EXPECT_EQ(json["maxzoom"], 9);
  EXPECT_EQ(json["attribution"], "A. Pilot");
  EXPECT_EQ(GetMap("/a%20b/imagery/tiles.json?format=png").status, 400);
  EXPECT_EQ(GetMap("/a%20b/hillshade/tiles.json?format=jpg").status, 400);
  EXPECT_EQ(GetMap("/a%20b/hillshade/tiles.json?interval=3").status, 400);
  EXPECT_EQ(GetMap("/nope/slope/tiles.json").status, 404);
}

TEST_F(TileJsonHandlerTest, HasNoMapsOfImagesBeyondWebMercator) {
  datasets_[0].imagery = {{-180, 86, 180, 90}, 9, 8};
  const Response reply = GetMap("/a%20b/imagery/tiles.json");
  EXPECT_EQ(reply.status, 404);
  EXPECT_NE(reply.body->find("the image lies beyond 85.05"), std::string::npos) << *reply.body;
  EXPECT_EQ(GetMap("/a%20b/slope/tiles.json").status, 200) << "of the heights";
  datasets_[0].imagery->bounds.south = 80;
  EXPECT_EQ(GetMap("/a%20b/imagery/tiles.json").status, 200);
}

TEST_F(TileJsonHandlerTest, RefusesWhatItCannotServe) {
  EXPECT_EQ(Get("/nope/tiles.json").status, 404);
  EXPECT_EQ(Get("/a%20b/tiles.json?size=1").status, 400);
  EXPECT_EQ(Get("/a%20b/tiles.json?error=1").status, 400);
}

}  // namespace
}  // namespace terrace::server

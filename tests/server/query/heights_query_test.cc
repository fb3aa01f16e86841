#include "server/query/heights_query.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <stop_token>
#include <string>
#include <vector>

#include "server/handlers/handlers.h"
#include "server/query/heights_parameters.h"
#include "tiler/surface/drawn_tiles.h"

namespace terrace::server {
namespace {

Result<HeightsQuery> Parse(const char* query, std::size_t max_locations = 100) {
  return ParseHeights({query, {}, {}}, max_locations);
}

std::string Refusal(const char* query, std::size_t max_locations = 100) {
  const Result<HeightsQuery> parsed = Parse(query, max_locations);
  EXPECT_FALSE(parsed) << query;
  if (parsed) return {};
  EXPECT_EQ(parsed.error().code, ErrorCode::kInvalidArgument) << query;
  return parsed.error().message;
}

TEST(HeightsQuery, ReadsLatitudeBeforeLongitude) {
  const Result<HeightsQuery> query = Parse("locations=46.5,8.25|-90,-180%7C1e1, 2.&v=7");
  ASSERT_TRUE(query) << query.error().message;
  ASSERT_EQ(query->points.size(), 3u);
  EXPECT_EQ(query->points[0].latitude, 46.5);
  EXPECT_EQ(query->points[0].longitude, 8.25);
  EXPECT_EQ(query->points[1].latitude, -90);
  EXPECT_EQ(query->points[1].longitude, -180);
  EXPECT_EQ(query->points[2].latitude, 10);
  EXPECT_TRUE(query->distances_m.empty());
}

TEST(HeightsQuery, CountsFromTheEllipsoidUnlessToldOtherwise) {
  const auto datum = [](const char* query) { return Parse(query)->datum; };
  EXPECT_EQ(datum("locations=1,2"), dem::HeightDatum::kEllipsoid);
  EXPECT_EQ(datum("locations=1,2&datum=ellipsoid"), dem::HeightDatum::kEllipsoid);
  EXPECT_EQ(datum("locations=1,2&datum=orthometric"), dem::HeightDatum::kOrthometric);
  EXPECT_EQ(datum("path=1,2|3,4&samples=3&datum=orthometric"), dem::HeightDatum::kOrthometric);
}

TEST(HeightsQuery, CertifiesDownToALevel) {
  const auto level = [](const char* query) { return Parse(query)->certify_level; };
  EXPECT_EQ(level("locations=1,2"), std::nullopt);
  EXPECT_EQ(level("locations=1,2&certify=0"), 0);
  EXPECT_EQ(level("locations=1,2&certify=12&datum=orthometric"), 12);
  EXPECT_EQ(level("path=1,2|3,4&samples=3&certify=deepest"), geo::kMaxLevel);
}

TEST(HeightsQuery, NamesTheItemThatIsWrong) {
  const struct {
    const char* query;
    const char* says;
  } cases[] = {
      {"locations=1,2|91,0", "item 2: the latitude"},
      {"locations=1,2|-90.0001,0", "item 2: the latitude"},
      {"locations=1,180.0001", "item 1: the longitude"},
      {"locations=nan,0", "item 1: the latitude"},
      {"locations=0,inf", "item 1: the longitude"},
      {"locations=0,-infinity", "item 1: the longitude"},
      {"locations=1e999,0", "item 1: the latitude"},
      {"locations=0x1,0", "item 1: the latitude"},
      {"locations=%2B1,0", "item 1: the latitude"},
      {"locations=1,2,3", "item 1: the longitude"},
      {"locations=1,", "item 1: the longitude"},
      {"locations=1,2|", "item 2 is not"},
      {"locations=|1,2", "item 1 is not"},
      {"locations=1 2", "item 1 is not"},
      {"locations=1.2.3,0", "item 1: the latitude"},
      {"locations=", "locations is empty"},
      {"locations=%20", "locations is empty"},
      {"path=1,2|x,0&samples=2", "path: item 2: the latitude"},
      {"path=1,2&samples=2", "at least two points"},
      {"path=&samples=2", "path is empty"},
      {"path=1,2|3,4", "either step"},
      {"path=1,2|3,4&samples=2&step=2", "either step"},
      {"path=1,2|3,4&samples=1", "samples must be"},
      {"path=1,2|3,4&samples=-5", "samples must be"},
      {"path=1,2|3,4&samples=2.5", "samples must be"},
      {"path=1,2|3,4&samples=", "samples must be"},
      {"path=1,2|3,4&samples=101", "more than 100 points"},
      {"path=1,2|3,4&samples=99999999999999999999999", "more than 100 points"},
      {"path=1,2|3,4&step=0", "step must be"},
      {"path=1,2|3,4&step=-1", "step must be"},
      {"path=1,2|3,4&step=nan", "step must be"},
      {"path=1,2|3,4&step=1e-300", "more than 100 points"},
      {"locations=1,2&step=5", "need path"},
      {"locations=1,2&path=1,2|3,4&samples=2", "either locations or path"},
      {"", "either locations or path"},
      {"locations=1,2&locations=1,2", "locations is given more than once"},
      {"locations=1,2&interpolation=cubic", "unknown parameter"},
      {"locations=1,2&datum=egm96", "datum must be ellipsoid or orthometric"},
      {"locations=1,2&datum=", "datum must be"},
      {"locations=1,2&certify=", "certify must be deepest"},
      {"locations=1,2&certify=-1", "certify must be deepest"},
      {"locations=1,2&certify=25", "a level from 0 to 24"},
      {"locations=1,2&certify=3x", "certify must be deepest"},
      {"locations=1,2&certify=1&certify=1", "certify is given more than once"},
      {"locations=1,2&datum=ellipsoid&datum=ellipsoid", "datum is given more than once"},
  };
  for (const auto& c : cases) {
    const std::string message = Refusal(c.query);
    EXPECT_NE(message.find(c.says), std::string::npos) << c.query << ": " << message;
  }
}

TEST(HeightsQuery, TakesAsManyAsItMayAndNoMore) {
  EXPECT_TRUE(Parse("locations=1,2|1,2|1,2", 3));
  EXPECT_NE(Refusal("locations=1,2|1,2|1,2|1,2", 3)
                .find("more than 3 points, which is max_locations of this server; ask for fewer"),
            std::string::npos);
  EXPECT_TRUE(Parse("path=0,0|0,1&samples=3", 3));
  EXPECT_TRUE(Parse("path=0,0|0,1&step=60000", 3));
  EXPECT_NE(Refusal("path=0,0|0,1&step=50000", 3).find("in steps of 50000 m"), std::string::npos);
}

TEST(HeightsQuery, WalksAlongAPath) {
  const Result<HeightsQuery> query = Parse("path=0,10|0,11&step=50000");
  ASSERT_TRUE(query) << query.error().message;
  ASSERT_EQ(query->points.size(), 4u);
  EXPECT_EQ(query->distances_m, (std::vector<double>{0, 50'000, 100'000, 111'319.491}));
  EXPECT_EQ(query->points.back().longitude, 11);
}

constexpr const char* kJson = "application/json";
constexpr const char* kForm = "application/x-www-form-urlencoded";

Result<HeightsQuery> ParseBody(const char* type, std::string_view body, std::size_t max_locations = 100) {
  return ParseHeights({"v=1", type, body}, max_locations);
}

TEST(HeightsQuery, ReadsBodies) {
  const auto path =
      ParseBody("Application/JSON; charset=utf-8", R"( {"path": "0,10|0,11", "step": 5e4, "certify": 3, "v": "x"} )");
  ASSERT_TRUE(path) << path.error().message;
  EXPECT_EQ(path->distances_m, (std::vector<double>{0, 50'000, 100'000, 111'319.491}));
  EXPECT_EQ(path->certify_level, 3);
  const auto samples = ParseBody(kJson, R"({"samples": 3.0, "path": "1,2|3,4"})");
  ASSERT_TRUE(samples) << samples.error().message;
  EXPECT_EQ(samples->points.size(), 3u);
  const auto form = ParseBody(kForm, "locations=1%2C2%7C3%2C+4&v=1&&v=2");
  ASSERT_TRUE(form) << form.error().message;
  ASSERT_EQ(form->points.size(), 2u);
  EXPECT_EQ(form->points[1].longitude, 4);
  for (const char* body : {"\xEF\xBB\xBF{\"locations\": \"1,2|3,4\"}", "{\"\\u006cocations\": \"1,2\\u007c3,\\u0034\"}",
                           "\r\n\t{\"locations\"\n:\"1,2|3,4\" , \"datum\":\"orthometric\"}\n"}) {
    const auto json = ParseBody(kJson, body);
    ASSERT_TRUE(json) << body << ": " << json.error().message;
    EXPECT_EQ(json->points.size(), 2u) << body;
  }
}

TEST(HeightsQuery, ReadsPartsOfAnySize) {
  const std::string_view json = R"({"locations": "1\u002c2|3.5,-4e1", "datum": "orthometric", "certify": 12.00,
                                    "error": 10.050, "fraction": 1.0e2})";
  const std::string_view form = "locations=1%2c2%7C3.5,-4e1&datum=orthometric&certify=12&error=10.050&fraction=1.0e2";
  for (std::size_t size = 1; size <= json.size(); ++size) {
    for (const bool is_json : {true, false}) {
      std::string_view rest = is_json ? json : form;
      const TextParts parts = [&]() -> Result<std::string_view> {
        const std::string_view part = rest.substr(0, size);
        rest.remove_prefix(part.size());
        return part;
      };
      std::vector<dem::GeoPosition> points;
      ListParameters parameters = HeightsParameters(2, json.size(), points);
      std::size_t at = 0;
      const Result<void> read =
          is_json ? ReadJsonObject(parts, parameters, at) : ReadForm(parts, PlusSign::kIsBlank, parameters, at);
      ASSERT_TRUE(read) << size << ": " << read.error().message;
      EXPECT_EQ(at, (is_json ? json : form).size());
      ASSERT_EQ(points.size(), 2u);
      EXPECT_EQ(points[0].longitude, 2);
      EXPECT_EQ(points[1].longitude, -40);
      EXPECT_EQ(parameters.texts().at("datum"), "orthometric");
      EXPECT_EQ(parameters.texts().at("certify"), "12");
      EXPECT_EQ(parameters.texts().at("error"), "10.050");
      EXPECT_EQ(parameters.texts().at("fraction"), "1.0e2");
    }
  }
}

TEST(HeightsQuery, NamesTheByteWhereABodyIsWrong) {
  const struct {
    const char* type;
    const char* body;
    const char* says;
  } cases[] = {
      {kJson, "", R"(the body is empty; send a JSON object, such as {"locations": ")"},
      {kJson, "{", "byte 1: this is no valid JSON"},
      {kJson, "NaN", "byte 0: this is no valid JSON"},
      {kJson, "{\"locations\": \"\xff\"}", "this is no valid JSON"},
      {kJson, R"({"locations": "1,2"} x)", "byte 21: this is no valid JSON"},
      {kJson, R"({"locations": "1,2"}{})", "byte 20: this is no valid JSON"},
      {kJson, "[]", "byte 0: this is not a JSON object"},
      {kJson, "null", "this is not a JSON object"},
      {kJson, "\"1,2\"", "this is not a JSON object"},
      {kJson, "7", "this is not a JSON object"},
      {kJson, R"({"locations": ["1,2"]})", "byte 14: values must be texts or numbers"},
      {kJson, R"({"locations": null})", "values must be texts or numbers"},
      {kJson, R"({"locations": {"a": 1}})", "byte 14: values must be texts or numbers"},
      {kJson, R"({"locations": true})", "values must be texts or numbers"},
      {kJson, R"({"interpolation": 1})", "unknown parameter; known are locations"},
      {kJson, R"({"locations": "1,2", "locations": "3,4"})", "locations is given more than once"},
      {kJson, R"({"locations": "1,2", "\u006cocations": "3,4"})", "locations is given more than once"},
      {kJson, R"({"locations": "1,2", "path": "3,4"})", "either locations or path"},
      {kJson, R"({"locations": "1,2|91,0|1,2"})", "locations: item 2: the latitude"},
      {kForm, "locations=1,2&step=%zz", "byte 21: malformed percent-encoding"},
      {kForm, "locations=1,2&datum=%0a", "malformed percent-encoding"},
      {kForm, "locations=1,2%7", "malformed percent-encoding"},
      {kForm, "%6cocations=1,2", "byte 1: a parameter's name has a percent sign"},
  };
  for (const auto& c : cases) {
    const auto refused = ParseBody(c.type, c.body);
    ASSERT_FALSE(refused) << c.body;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument) << c.body;
    EXPECT_NE(refused.error().message.find(c.says), std::string::npos) << c.body << ": " << refused.error().message;
  }
  const auto twice = ParseHeights({"locations=1,2", kJson, R"({"locations": "1,2"})"}, 9);
  ASSERT_FALSE(twice);
  EXPECT_NE(twice.error().message.find("given more than once"), std::string::npos);
}

TEST(HeightsQuery, KnowsTheTypesOfBodies) {
  for (const char* type :
       {"", "text/plain", "application/xml", "multipart/form-data; boundary=x", "application/jsonx"}) {
    EXPECT_FALSE(IsPointsBody(type)) << type;
  }
  EXPECT_TRUE(IsPointsBody("Application/JSON ; charset=utf-8"));
}

TEST(HeightsQuery, IsCancelledWhileItReadsAndWalks) {
  std::stop_source source;
  source.request_stop();
  for (const char* query : {"locations=1,2", "path=1,2|3,4&samples=9"}) {
    const auto cancelled = ParseHeights({query, {}, {}}, 100, source.get_token());
    ASSERT_FALSE(cancelled);
    EXPECT_EQ(cancelled.error().code, ErrorCode::kCancelled);
  }
}

TEST(HeightsJson, IsWhatOpenTopoDataSends) {
  HeightsQuery query;
  query.points = {{8.5, 46.5}, {-170, 0}};
  const tiler::PointHeights heights{{1473.25f, std::numeric_limits<float>::quiet_NaN()}};
  EXPECT_EQ(HeightsJson(query, heights, "alps"),
            R"({"results":[{"elevation":1473.25,"location":{"lat":46.5,"lng":8.5},"dataset":"alps"},)"
            R"({"elevation":null,"location":{"lat":0,"lng":-170},"dataset":"alps"}],"status":"OK"})");
  query.distances_m = {0, 1234.5};
  const auto json = nlohmann::json::parse(HeightsJson(query, heights, "\"q\""));
  EXPECT_EQ(json["results"][1]["distance"], 1234.5);
  EXPECT_EQ(json["results"][0]["dataset"], "\"q\"");
}

TEST(HeightsJson, SaysWhatWasFilledIn) {
  HeightsQuery query;
  query.points = {{8.5, 46.5}, {8.6, 46.5}, {-170, 0}};
  tiler::PointHeights heights{std::vector<float>{1473.25f, 1500, std::numeric_limits<float>::quiet_NaN()}};
  heights.filled = {1, 0, 1};
  EXPECT_EQ(HeightsJson(query, heights, "a"),
            R"({"results":[{"elevation":1473.25,"location":{"lat":46.5,"lng":8.5},"filled":true,"dataset":"a"},)"
            R"({"elevation":1500,"location":{"lat":46.5,"lng":8.6},"dataset":"a"},)"
            R"({"elevation":null,"location":{"lat":0,"lng":-170},"dataset":"a"}],"status":"OK"})");
  CertifiedPoints certified;
  certified.tiles = {{12, 4289, 3105}};
  certified.tile_of_point = {0, 0, 0};
  certified.errors_m = {12.5};
  const auto json = nlohmann::json::parse(HeightsJson(query, heights, "a", &certified));
  EXPECT_TRUE(json["results"][0]["certified_error"].is_null());
  EXPECT_EQ(json["results"][1]["certified_error"], 12.5);
}

TEST(HeightsJson, SaysWhichTileIsHowFarOff) {
  HeightsQuery query;
  query.points = {{8.5, 46.5}, {-170, 0}, {8.6, 46.5}};
  const tiler::PointHeights heights{{1473.25f, std::numeric_limits<float>::quiet_NaN(), 1500}};
  CertifiedPoints certified;
  certified.tiles = {{12, 4289, 3105}, {0, 0, 0}, {12, 4291, 3105}};
  certified.tile_of_point = {0, 1, 2};
  certified.errors_m = {12.3456781, 7, std::nullopt};
  EXPECT_EQ(
      HeightsJson(query, heights, "alps", &certified),
      R"({"results":[{"elevation":1473.25,"location":{"lat":46.5,"lng":8.5},"certified_error":12.3457,"tile":"12/4289/3105","dataset":"alps"},)"
      R"({"elevation":null,"location":{"lat":0,"lng":-170},"dataset":"alps"},)"
      R"({"elevation":1500,"location":{"lat":46.5,"lng":8.6},"certified_error":null,"tile":"12/4291/3105","dataset":"alps"}],"status":"OK"})");
}

TEST(CertifiedPoints, LieInTheDeepestTilesThereAre) {
  DatasetView dataset;
  dataset.available = {{{0, 0, 1, 0}}, {{2, 1, 2, 1}}};  // 0..90 east, 0..90 north at level 1
  const std::vector<dem::GeoPosition> points = {{45, 45}, {100, 45}, {0, 0}, {-0.001, 0}, {180, 90}, {-180, -90}};
  const auto deepest = CertifyingTilesOf(dataset, points, geo::kMaxLevel);
  ASSERT_TRUE(deepest);
  const std::vector<geo::TileKey> tiles = {{1, 2, 1}, {0, 1, 0}, {0, 0, 0}};
  EXPECT_EQ(deepest->tiles, tiles);
  EXPECT_EQ(deepest->tile_of_point, (std::vector<std::uint32_t>{0, 1, 0, 2, 2, 2}));
  EXPECT_EQ(deepest->errors_m.size(), 3u);
  EXPECT_EQ(CertifyingTilesOf(dataset, points, 0)->tiles, (std::vector<geo::TileKey>{{0, 1, 0}, {0, 0, 0}}));
}

TEST(CertifiedPoints, AreRefusedInTooManyTiles) {
  DatasetView dataset;
  for (int level = 0; level <= 6; ++level) {
    dataset.available.push_back({{0, 0, geo::TileColumns(level) - 1, geo::TileRows(level) - 1}});
  }
  std::vector<dem::GeoPosition> points;
  for (std::size_t i = 0; i <= tiler::kMaxTilesRead; ++i) points.push_back({static_cast<double>(i) * 2.8125 - 179, 1});
  const auto refused = CertifyingTilesOf(dataset, points, 6);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(CertifyingTilesOf(dataset, points, 5));
  points.pop_back();
  EXPECT_TRUE(CertifyingTilesOf(dataset, points, 6));
}

}  // namespace
}  // namespace terrace::server

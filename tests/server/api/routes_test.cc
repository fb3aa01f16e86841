#include "server/routes.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <string>
#include <string_view>

#include "config/options/option_table.h"
#include "server/api/tile_formats.h"
#include "server/http/text.h"
#include "server/telemetry/redact.h"
#include "tests/support/source_dir.h"

namespace terrace::server {
namespace {

TEST(Routes, FindsEveryUrl) {
  const struct {
    const char* target;
    const char* label;
  } cases[] = {
      {"/", "viewer"},
      {"/?dataset=maui", "viewer"},
      {"/viewer/", "viewer"},
      {"/viewer/app.js", "viewer"},
      {"/viewer/tiles.json", "viewer"},  // has the name of a dataset's URL
      {"/viewer/heights", "viewer"},
      {"/viewer/3/4/5.png", "viewer"},
      {"/datasets", "datasets"},
      {"/livez", "livez"},
      {"/readyz", "readyz"},
      {"/metrics", "metrics"},
      {"/maui/layer.json", "layer"},
      {"/maui/layer.json?error=5", "layer"},
      {"/maui/tileset.json?error=5", "tileset"},
      {"/maui/3dtiles/9-272-359/0/0/0.6.subtree", "subtree"},
      {"/maui/3dtiles/9-272-359/0/0/0.glb?error=5&atleast=1", "tile"},
      {"/maui/0/1/0.terrain", "tile"},
      {"/maui/0/1/0.glb", "tile"},
      {"/maui/0/0/0.png", "tile"},
      {"/maui/tiles.json", "tilejson"},
      {"/maui/edits.geojson", "edits"},
      {"/maui/heights?locations=1,2", "heights"},
      {"/maui/mesh?bbox=0,0,1,1&error=5", "mesh"},
      {"http://example.test/maui/0/1/0.terrain", "tile"},
      {"http://example.test", "viewer"},
      {"/a%20b/layer.json", "layer"},
  };
  for (const auto& c : cases) {
    const Result<Route> route = Routes().Match(c.target);
    ASSERT_TRUE(route) << c.target << ": " << route.error().message;
    EXPECT_EQ(route->row->label, c.label) << c.target;
  }
}

TEST(Routes, ReadsTheTileAndTheQuery) {
  const Result<Route> route = Routes().Match("/ma%75i/9/533/388.terrain?error=5&v=1");
  ASSERT_TRUE(route);
  EXPECT_EQ(route->dataset, "maui");
  EXPECT_EQ(route->key, (geo::TileKey{9, 533, 388}));
  EXPECT_EQ(route->query, "error=5&v=1");
  EXPECT_EQ(route->format->format, tiler::TileFormat::kQuantizedMesh);
  const Result<Route> glb = Routes().Match("/maui/9/533/388.glb?compression=none");
  ASSERT_TRUE(glb);
  EXPECT_EQ(glb->key, route->key);
  EXPECT_EQ(glb->format->format, tiler::TileFormat::kGlb);
  EXPECT_EQ(Routes().Match("/maui/3/7/0.png")->format->format, tiler::TileFormat::kHeightPng);
  EXPECT_EQ(Routes().Match("/maui/hillshade/3/7/0.webp")->format->picture, proto::PictureFormat::kWebp);
  EXPECT_EQ(Routes().Match("/maui/contours/3/7/0.mvt")->format->format, tiler::TileFormat::kContours);
  EXPECT_EQ(Routes().Match("/maui/imagery/3/7/0.jpg")->format->format, tiler::TileFormat::kImagery);
  const Result<Route> geodetic = Routes().Match("/maui/imagery/geodetic/3/15/7.webp");
  ASSERT_TRUE(geodetic) << "two roots";
  EXPECT_EQ(geodetic->format->format, tiler::TileFormat::kGeodeticImagery);
  EXPECT_EQ(geodetic->key, (geo::TileKey{3, 15, 7}));
  EXPECT_EQ(Routes().Match("/maui/slope/tiles.json")->format->format, tiler::TileFormat::kSlope);
  EXPECT_EQ(Routes().Match("/viewer/a/b.js")->file, "a/b.js");
  EXPECT_EQ(Routes().Match("/")->file, "index.html");
  EXPECT_EQ(Routes().Match("/viewer/")->file, "index.html");
}

TEST(Routes, CountsImplicitTilesFromTheGlobesRoots) {
  const Result<Route> content = Routes().Match("/maui/3dtiles/9-272-359/3/5/2.glb");
  ASSERT_TRUE(content);
  EXPECT_EQ(content->dataset, "maui");
  EXPECT_EQ(content->format->format, tiler::TileFormat::kGlb);
  EXPECT_EQ(content->key, (geo::TileKey{12, 272 * 8 + 5, 359 * 8 + 2}));
  const Result<Route> subtree = Routes().Match("/maui/3dtiles/0-1-0/6/63/0.6.subtree");
  ASSERT_TRUE(subtree);
  EXPECT_EQ(subtree->root, (geo::TileKey{0, 1, 0}));
  EXPECT_EQ(subtree->key, (geo::TileKey{6, 64 + 63, 0}));
  EXPECT_EQ(subtree->subtree_levels, 6);
}

TEST(Routes, RefusesWhatIsNoUrl) {
  const char* const not_found[] = {
      "/nope",
      "/maui",
      "/maui/",
      "/maui/layer.json/",
      "//",
      "/maui/0/0",
      "/maui/0/0/0",
      "/maui/0/0/0.terrain/",
      "/maui/0/0/0.jpg",
      "/maui/0/1/0.png",  // Web Mercator has one root
      "/maui/1/0/2.png",
      "/maui/1/2/0.png",
      "/maui/25/0/0.png",
      "/maui/hillshade/0/1/0.png",
      "/maui/hillshade/0/0/0.jpg",
      "/maui/slope/0/0/0.mvt",
      "/maui/contours/0/0/0.png",
      "/maui/shade/0/0/0.png",
      "/maui/imagery/geodetic/0/2/0.webp",
      "/maui/hillshade/geodetic/0/0/0.png",
      "/maui/imagery/geodetic/tiles.json",
      "/maui/hillshade/layer.json",
      "/tiles.json",
      "/maui/heights/",
      "/maui/0/0/.terrain",
      "/maui/0/0/.glb",
      "/maui/0/0/0.glb.terrain",
      "/maui/0/2/0.glb",
      // No root, no place under it, or below the deepest level.
      "/maui/3dtiles/9-272-359/0/0/0.terrain",
      "/maui/3dtiles/9-272-359/0/0/0",
      "/maui/3dtiles/9-272-359/0/0/.6.subtree",
      "/maui/3dtiles/9-272-359/0/0/0.6.subtree.glb",
      "/maui/3dtiles/9-272/0/0/0.6.subtree",
      "/maui/3dtiles/9-272-359-0/0/0/0.6.subtree",
      "/maui/3dtiles/9-272--359/0/0/0.6.subtree",
      "/maui/3dtiles/09-272-359/0/0/0.6.subtree",
      "/maui/3dtiles/0-2-0/0/0/0.6.subtree",
      "/maui/3dtiles/9-272-359/0/1/0.6.subtree",
      "/maui/3dtiles/9-272-359/2/0/4.glb",
      "/maui/3dtiles/9-272-359/16/0/0.6.subtree",
      "/maui/3dtiles/9-272-359/999999999/0/0.6.subtree",
      "/maui/3dtiles/9-272-359/00/0/0.6.subtree",
      "/maui/3dtiles/9-272-359/0/0",
      "/maui/3dtile/9-272-359/0/0/0.6.subtree",
      "/maui/3dtiles/9-272-359/0/0/0.subtree",
      "/maui/3dtiles/9-272-359/0/0/0.0.subtree",
      "/maui/3dtiles/9-272-359/0/0/0.8.subtree",
      "/maui/3dtiles/9-272-359/0/0/0.06.subtree",
      "/maui/3dtiles/9-272-359/0/0/0.6.6.subtree",
      "/viewer2/tileset.json/",
      "/metrics/tileset.json",
      "/datasets/",
      "/livez/x",
      "/datasets/layer.json",
      "/metrics/0/0/0.terrain",
      "/viewer",
      // Numbers that name no tile.
      "/maui/x/0/0.terrain",
      "/maui/-1/0/0.terrain",
      "/maui/0/-1/0.terrain",
      "/maui/0/0/-0.terrain",
      "/maui/+1/0/0.terrain",
      "/maui/0x1/0/0.terrain",
      "/maui/1e1/0/0.terrain",
      "/maui/1.0/0/0.terrain",
      "/maui/00/0/0.terrain",
      "/maui/01/0/0.terrain",
      "/maui/%201/0/0.terrain",
      "/maui/1%20/0/0.terrain",
      "/maui/%2d1/0/0.terrain",
      // Outside the tiling scheme, and out of any integer.
      "/maui/0/2/0.terrain",
      "/maui/0/0/1.terrain",
      "/maui/25/0/0.terrain",
      "/maui/24/33554432/0.terrain",
      "/maui/64/0/0.terrain",
      "/maui/999999999/0/0.terrain",
      "/maui/0/4294967296/0.terrain",
      "/maui/0/18446744073709551616/0.terrain",
      "/maui/18446744073709551616/0/0.terrain",
      "/maui/9/99999999999999999999999999999999999999/0.terrain",
      "/../etc/passwd",
      "/%2e%2e/%2e%2e/etc/passwd",
  };
  for (const char* target : not_found) {
    const Result<Route> route = Routes().Match(target);
    ASSERT_FALSE(route) << target;
    EXPECT_EQ(route.error().code, ErrorCode::kNotFound) << target;
  }
}

TEST(Routes, TakesTheLastTileOfTheDeepestLevel) { EXPECT_TRUE(Routes().Match("/maui/24/33554431/16777215.terrain")); }

TEST(Routes, RefusesMalformedTargets) {
  for (const char* target : {"", "maui", "*", "ftp://x/", "http://x?y", "/a#b", "/%", "/%4", "/%zz",
                             "/a%00b/layer.json", "/a%0d%0ab/layer.json"}) {
    const Result<Route> route = Routes().Match(target);
    ASSERT_FALSE(route) << target;
    EXPECT_EQ(route.error().code, ErrorCode::kInvalidArgument) << target;
  }
}

TEST(Routes, ReservesTheNamesOfItsOwnUrls) {
  std::set<std::string> own;
  for (const DocumentedUrl& url : DocumentedUrls()) {
    const std::string first = url.pattern.substr(1, url.pattern.find('/', 1) - 1);
    if (!first.empty() && first.find('{') == std::string::npos) own.insert(first);
  }
  const auto reserved = config::ReservedDatasetNames();
  EXPECT_EQ(own, std::set<std::string>(reserved.begin(), reserved.end())) << "see config/options/dataset_name.cc";
  for (const std::string& name : own) EXPECT_TRUE(Routes().IsReserved(name)) << name;
  for (const char* name : {"maui", "", "layer.json", "{dataset}"}) EXPECT_FALSE(Routes().IsReserved(name)) << name;
}

TEST(Routes, DescribesEachUrl) {
  std::set<std::string_view> ids;
  for (const DocumentedUrl& url : DocumentedUrls()) {
    ASSERT_NE(url.operation, nullptr) << url.pattern << ": name its Operation in server/routes.cc or tile_formats.cc";
    EXPECT_TRUE(ids.insert(url.operation->id).second) << url.operation->id;
    for (const ExampleRequest& example : url.operation->examples) {
      const Result<Route> route = Routes().Match(example.target);
      ASSERT_TRUE(route) << example.target;
      EXPECT_EQ(route->row->takes_post() || example.body_type.empty(), true) << example.target;
      for (const std::string_view name : VariablesOf(url.pattern)) {
        EXPECT_TRUE(ValueIn(example.target, url.pattern, name)) << example.target << " " << name;
      }
    }
    // The log may show it.
    for (const ParameterNote& note : url.operation->parameters) {
      EXPECT_TRUE(IsPlainTarget("/maui/x?" + std::string(note.name) + "=1")) << note.name;
    }
  }
  EXPECT_GE(ids.size(), 20U);
}

// The regular expression of docker/nginx.conf.template for requests that are cached.
std::regex PlainInNginx() {
  std::ifstream file(test_support::SourceDir() / "docker/nginx.conf.template");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::smatch found;
  EXPECT_TRUE(std::regex_search(text, found, std::regex("map \\$request_uri[^~]*\"~(.*)\" \\$request_uri;")));
  return std::regex(found[1].str());
}

// As URLSearchParams of browsers and urlencode of Python write it.
std::string Encoded(std::string_view target) {
  std::string encoded;
  for (const char c : target) {
    if (c == ',' || c == '|' || c == ':') {
      encoded += PercentEncode({&c, 1});
    } else {
      encoded += c;
    }
  }
  return encoded;
}

class OpenApi : public testing::Test {
 protected:
  // The operation of an id.
  const nlohmann::json& Of(std::string_view id) const {
    for (const auto& path : document_["paths"]) {
      for (const auto& operation : path) {
        if (operation["operationId"] == id) return operation;
      }
    }
    ADD_FAILURE() << id;
    return document_;
  }

  const nlohmann::json document_ = nlohmann::json::parse(WriteOpenApi(DocumentedUrls()));
};

TEST_F(OpenApi, BodiesHaveTheTypesOfTheQueryAndItsVersion) {
  const auto& content = Of("getHeightsByPost")["requestBody"]["content"];
  const auto& members = content["application/json"]["schema"]["properties"];
  EXPECT_EQ(members["samples"]["type"], nlohmann::json::parse(R"(["integer","string"])"));
  EXPECT_EQ(members["samples"]["minimum"], 2);
  EXPECT_EQ(members["normals"]["enum"], nlohmann::json::parse(R"(["0","1",0,1])"));
  EXPECT_EQ(members["surface"]["enum"], nlohmann::json::parse(R"(["source","served"])"));
  EXPECT_TRUE(members.contains("v"));
}

TEST_F(OpenApi, NumbersAreRepliesToNumbersAlone) {
  for (const std::string id : {"getHeights", "getSight"}) {
    EXPECT_FALSE(Of(id)["responses"]["200"]["content"].contains("application/octet-stream")) << id;
    EXPECT_TRUE(Of(id + "ByPost")["responses"]["200"]["content"].contains("application/octet-stream")) << id;
  }
  EXPECT_TRUE(Of("getGrid")["responses"]["200"]["content"].contains("application/octet-stream"));
}

TEST_F(OpenApi, EveryUrlMayBeRefusedForTooManyConnections) {
  for (const auto& [pattern, path] : document_["paths"].items()) {
    EXPECT_TRUE(path["get"]["responses"].contains("429")) << pattern;
  }
}

TEST_F(OpenApi, TilesThatVarySaySo) {
  for (const TileFormatRow& row : TileFormatRows()) {
    tiler::TileRequest tile;
    tile.format = row.format;
    const auto& headers = row.operation->headers;
    if (!row.vary(tile).empty()) {
      EXPECT_EQ(std::ranges::count(headers, "Vary"), 1) << row.operation->id;
    }
  }
}

// Otherwise its reply is private even with a version, and the log leaves a part of it out.
TEST(Routes, KnowsThatNoExampleIsASecret) {
  const std::regex of_nginx = PlainInNginx();
  int count = 0;
  const auto expect_plain = [&](const std::string& target) {
    ++count;
    for (const std::string& sent : {target, Encoded(target)}) {
      EXPECT_TRUE(IsPlainTarget(sent)) << sent;
      EXPECT_EQ(RedactTarget(sent, true), sent);
      EXPECT_TRUE(std::regex_search(sent, of_nginx)) << sent << " in docker/nginx.conf.template";
    }
  };
  for (const DocumentedUrl& url : DocumentedUrls()) {
    for (const ExampleRequest& example : url.operation->examples) {
      if (Routes().Match(example.target)->row->label != "viewer") expect_plain(std::string(example.target));
    }
    for (const ParameterNote& note : url.operation->parameters) {
      const auto schema = nlohmann::json::parse(note.schema);
      for (const nlohmann::json& value : schema.value("enum", nlohmann::json::array())) {
        expect_plain(
            fmt::format("/maui/x?{}={}", note.name, value.is_string() ? value.get<std::string>() : value.dump()));
      }
    }
  }
  EXPECT_GE(count, 100);
  EXPECT_FALSE(std::regex_search("/maui/grid?crs=EPSG:1s", of_nginx));
  EXPECT_FALSE(std::regex_search("/maui/grid?crs=EPSG:1234567", of_nginx));
  EXPECT_FALSE(std::regex_search("/maui/grid?width=a:1", of_nginx));
}

TEST(Routes, TellsWhichUrlsTakeABodyAndHowLarge) {
  EXPECT_EQ(Routes().Match("/maui/heights")->row->max_body_bytes(10), 4096U + 640U);
  for (const char* target : {"/", "/datasets", "/maui/mesh", "/maui/0/0/0.terrain", "/metrics"}) {
    EXPECT_FALSE(Routes().Match(target)->row->takes_post()) << target;
  }
}

TEST(Routes, KeepsAnEncodedSlashInsideItsSegment) {
  EXPECT_EQ(Routes().Match("/a%2Fb/layer.json")->dataset, "a/b");
  EXPECT_EQ(Routes().Match("/viewer/..%2f..%2fetc%2fpasswd")->file, "../../etc/passwd")
      << "a key of a map, never a path";
}

}  // namespace
}  // namespace terrace::server

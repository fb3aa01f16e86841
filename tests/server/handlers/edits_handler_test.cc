#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stop_token>

#include "server/handlers/handlers.h"
#include "tests/server/handlers/at_once.h"

namespace terrace::server {
namespace {

dem::EditOutline Outline(const char* op, const char* file, bool is_area) {
  dem::EditOutline edit;
  edit.op = op;
  edit.file = file;
  edit.feature = 7;
  edit.is_area = is_area;
  edit.lines = {{{.longitude = -84.1000000000000014, .latitude = 36.25}, {.longitude = -84.2, .latitude = 36.3}}};
  return edit;
}

TEST(EditsHandler, WritesOutlinesInTheirOrder) {
  const auto json = nlohmann::json::parse(
      EditsGeoJson({Outline("hole", "/data/secret/a\"b.geojson", true), Outline("carve", "\xff.geojson", false)}));
  EXPECT_EQ(json["type"], "FeatureCollection");
  ASSERT_EQ(json["features"].size(), 2u);
  const auto& hole = json["features"][0];
  EXPECT_EQ(hole["type"], "Feature");
  EXPECT_EQ(hole["properties"],
            nlohmann::json({{"op", "hole"}, {"file", "a\"b.geojson"}, {"feature", 7}, {"area", true}}))
      << "without folders";
  EXPECT_EQ(hole["geometry"]["type"], "MultiLineString");
  EXPECT_EQ(hole["geometry"]["coordinates"], nlohmann::json::parse("[[[-84.1,36.25],[-84.2,36.3]]]"));
  EXPECT_EQ(json["features"][1]["properties"]["area"], false);
}

TEST(EditsHandler, WritesAnEmptyCollection) {
  EXPECT_EQ(EditsGeoJson({}), R"({"type":"FeatureCollection","features":[]})");
}

TEST(EditsHandler, Stops) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(EditsGeoJson({Outline("hole", "a", true)}, stop.get_token()), "");
}

// A file of outlines may be larger than the cache of documents.
TEST(EditsHandler, IsNotWrittenForClientsThatHaveIt) {
  const TestHandlerState state(std::vector<DatasetView>{});
  DocumentPlan plan;
  plan.key = "edits maui";
  plan.generation = 7;
  plan.content_type = "application/geo+json";
  plan.cache_control = "no-cache";
  plan.write = [](const std::stop_token&) -> DocumentText {
    ADD_FAILURE();
    return {};
  };
  const RenderedDocument written{std::make_shared<const std::string>("{}"), tiler::Coding::kIdentity, {}};
  Request request;
  const std::string etag = Serve(written, plan, request).etag;
  request.fields.Set(&RequestFields::if_none_match, etag);
  Answer answer = state.all.documents.Make(plan, TestContext("/maui/edits.geojson", request).context);
  ASSERT_TRUE(std::holds_alternative<Response>(answer));
  EXPECT_EQ(std::get<Response>(answer).status, 304);
  EXPECT_EQ(std::get<Response>(answer).etag, etag);
  plan.generation = 8;
  EXPECT_EQ(Serve(written, plan, request).status, 200);
}

}  // namespace
}  // namespace terrace::server

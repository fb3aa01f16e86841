#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "server/handlers/handlers.h"
#include "tests/server/handlers/at_once.h"

namespace terrace::server {
namespace {

class LayerHandlerTest : public testing::Test {
 protected:
  LayerHandlerTest() {
    datasets_[0].name = "maui";
    datasets_[0].generation = 0x0a1b2c3d4e5f6789;
    datasets_[0].attribution = "USGS";
    datasets_[0].available = {{{0, 0, 1, 0}}, {{0, 1, 0, 1}}};
    datasets_[0].bounds.west = 170;
    datasets_[0].bounds.east = -170;
    state_.emplace(datasets_);
  }
  Response Get(const char* target, const char* accept_encoding = "") {
    Request request;
    request.fields.Set(&RequestFields::accept_encoding, accept_encoding);
    return AtOnce(DescribeLayer(state_->all, TestContext(target, request).context), request);
  }

  std::vector<DatasetView> datasets_{1};
  std::optional<TestHandlerState> state_;
};

TEST_F(LayerHandlerTest, DescribesTheDataset) {
  const Response response = Get("/maui/layer.json");
  EXPECT_EQ(response.status, 200);
  EXPECT_EQ(response.content_type, "application/json");
  EXPECT_EQ(response.cache_control, "no-cache");
  const auto layer = nlohmann::json::parse(*response.body);
  EXPECT_EQ(layer["version"], "0a1b2c3d4e5f");
  EXPECT_EQ(layer["tiles"][0], "{z}/{x}/{y}.terrain?v=0a1b2c3d4e5f");
  EXPECT_EQ(layer["maxzoom"], 1);
  EXPECT_EQ(layer["available"].size(), 2u);
  EXPECT_EQ(layer["bounds"][0], -180) << "across the antimeridian: the whole turn";
  EXPECT_EQ(layer["bounds"][2], 180);
}

TEST_F(LayerHandlerTest, WritesParametersIntoTheTemplate) {
  const auto tiles = [&](const char* target) {
    return nlohmann::json::parse(*Get(target).body)["tiles"][0].get<std::string>();
  };
  EXPECT_NE(tiles("/maui/layer.json?error=5.00").find("error=5&atleast=1"), std::string::npos);
  EXPECT_NE(tiles("/maui/layer.json?fraction=.250").find("fraction=0.25"), std::string::npos);
  EXPECT_EQ(tiles("/maui/layer.json?v=1&extensions=a").find("error"), std::string::npos);
}

TEST_F(LayerHandlerTest, RefusesBadParametersAndUnknownDatasets) {
  EXPECT_EQ(Get("/maui/layer.json?error=x").status, 400);
  EXPECT_EQ(Get("/maui/layer.json?fraction=-1").status, 400);
  EXPECT_EQ(Get("/maui/layer.json?foo=1").status, 400);
  EXPECT_EQ(Get("/oahu/layer.json").status, 404);
}

TEST_F(LayerHandlerTest, CompressesOnRequest) {
  const Response plain = Get("/maui/layer.json"), gzip = Get("/maui/layer.json", "gzip");
  EXPECT_EQ(gzip.content_encoding, "gzip");
  EXPECT_NE(gzip.etag, plain.etag);
  EXPECT_LT(gzip.body->size(), plain.body->size());
  EXPECT_EQ(plain.vary, "Accept-Encoding") << "no document depends on Accept";
}

TEST(TileQuery, PrintsNumbersThatSurviveUrls) {
  geo::RequestedError requested;
  requested.error_m = 1e20;
  EXPECT_EQ(TileQuery(requested), "error=1e20&atleast=1") << "a '+' would become a space";
  requested.error_m = 0.1;
  EXPECT_EQ(TileQuery(requested), "error=0.1&atleast=1");
  EXPECT_EQ(TileQuery(geo::RequestedError()), "");
}

}  // namespace
}  // namespace terrace::server

#include "server/http/negotiate.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "engine/geo/error_ladder.h"

namespace terrace::server {
namespace {

TEST(Negotiate, ChoosesTheCodingByQuality) {
  const struct {
    const char* accept_encoding;
    Coding coding;
  } cases[] = {
      {"", Coding::kIdentity},
      {"gzip", Coding::kGzip},
      {"GZIP", Coding::kGzip},
      {"x-gzip", Coding::kGzip},
      {"gzip, deflate, br, zstd", Coding::kGzip},
      {"deflate, br", Coding::kIdentity},
      {"identity", Coding::kIdentity},
      {"*", Coding::kGzip},
      {"*;q=0", Coding::kIdentity},
      {"gzip;q=0", Coding::kIdentity},
      {"gzip;q=0.000, *", Coding::kIdentity},
      {"gzip; q=0.5", Coding::kGzip},
      {"gzip;q=0.5, identity;q=0.9", Coding::kIdentity},
      {"identity;q=0.5, gzip;q=0.9", Coding::kGzip},
      {"gzip;q=1, identity;q=1", Coding::kGzip},
      {"identity;q=0", Coding::kIdentity},  // nothing is left: plain bytes rather than none
      {"gzip;q=abc", Coding::kIdentity},
      {"gzip;q=2", Coding::kIdentity},
      {"gzip;q=nan", Coding::kIdentity},
      {",,, gzip ,;;", Coding::kGzip},
      {"gzipped", Coding::kIdentity},
  };
  for (const auto& c : cases) EXPECT_EQ(NegotiateCoding(c.accept_encoding), c.coding) << c.accept_encoding;
}

TEST(Negotiate, FindsTheNormalsWhereverClientsAskForThem) {
  const struct {
    const char* accept;
    std::vector<std::string> query;
    bool normals;
  } cases[] = {
      {"", {}, false},
      {"*/*", {}, false},
      {"application/vnd.quantized-mesh,application/octet-stream;q=0.9,*/*;q=0.01", {}, false},
      // CesiumJS
      {"application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata,application/octet-stream;q=0.9,*/"
       "*;q=0.01",
       {},
       true},
      {"application/vnd.quantized-mesh;extensions=metadata,application/octet-stream;q=0.9", {}, false},
      // 3DTilesRendererJS
      {"application/vnd.quantized-mesh,application/octet-stream;q=0.9;extensions=octvertexnormals-metadata", {}, true},
      // cesium-native
      {"", {"octvertexnormals-metadata"}, true},
      {"*/*", {"metadata", "watermask-octvertexnormals"}, true},
      {"", {"octvertexnormalsx"}, false},
      {"a/b; Extensions=\"octvertexnormals\"", {}, true},
      {"a/b;extensions=", {""}, false},
      {"a/b;xextensions=octvertexnormals", {}, false},
  };
  for (const auto& c : cases) EXPECT_EQ(WantsNormals(c.accept, c.query), c.normals) << c.accept;
}

ErrorWish Wish(std::optional<double> error_m, bool at_least = false, std::optional<double> fraction = {}) {
  ErrorWish wish;
  wish.error_m = error_m;
  wish.at_least = at_least;
  wish.fraction = fraction;
  return wish;
}

TEST(Negotiate, PutsErrorsOnTheLadder) {
  const double d = geo::DefaultError(10);
  EXPECT_EQ(ErrorStep(Wish({}), 10, 0.5), 0);
  EXPECT_EQ(ErrorStep(Wish(d), 10, 0.5), 0);
  EXPECT_EQ(ErrorStep(Wish(d * 0.99), 10, 0.5), 1) << "down, never up";
  EXPECT_EQ(ErrorStep(Wish(d / 2), 10, 0.5), 4);
  EXPECT_EQ(ErrorStep(Wish(d * 4), 10, 0.5), -8);
  EXPECT_EQ(ErrorStep(Wish(1e308), 24, 0.5), geo::kCoarsestStep);
  EXPECT_EQ(ErrorStep(Wish(5e-324), 0, 0.5), geo::kFinestStep);
}

TEST(Negotiate, AtLeastNeverGoesBelowTheDefault) {
  const double d = geo::DefaultError(10);
  EXPECT_EQ(ErrorStep(Wish(d / 8, true), 10, 0.5), 0);
  EXPECT_EQ(ErrorStep(Wish(d * 2, true), 10, 0.5), -4);
}

TEST(Negotiate, AFractionScalesEveryLevelAlike) {
  for (int level = 0; level <= 20; ++level) {
    EXPECT_EQ(ErrorStep(Wish({}, false, 0.5), level, 0.5), 0);
    EXPECT_EQ(ErrorStep(Wish({}, false, 0.25), level, 0.5), 4);
    EXPECT_EQ(ErrorStep(Wish({}, false, 0.25), level, 0.25), 0);
  }
  EXPECT_EQ(ErrorStep(Wish({}, false, 1e308), 0, 0.5), geo::kCoarsestStep) << "the product overflows";
  EXPECT_EQ(ErrorStep(Wish({}, false, 5e-324), 24, 0.5), geo::kFinestStep) << "the product underflows";
}

// A million wishes must not make a million cache entries.
TEST(Negotiate, ComesToFortyOneErrorsAtMost) {
  for (double e = -400; e < 400; e += 0.37) {
    const int step = ErrorStep(Wish(std::exp2(e)), 7, 0.5);
    EXPECT_GE(step, geo::kCoarsestStep);
    EXPECT_LE(step, geo::kFinestStep);
  }
}

TEST(Negotiate, HeightTilesAreThoseThatMeetTheBounds) {
  std::array<DatasetView, 1> datasets;
  datasets[0].name = "maui";
  datasets[0].west = 170;  // across the antimeridian
  datasets[0].east = -160;
  datasets[0].south = 10;
  datasets[0].north = 20;
  datasets[0].max_mercator_depth = 5;
  const auto find = [&](const char* target) {
    Request request;
    request.accept_encoding = "gzip";
    return Negotiate(*Match(target), request, datasets);
  };
  for (const char* there : {"/maui/0/0/0.png", "/maui/1/0/0.png", "/maui/1/1/0.png", "/maui/5/31/14.png",
                            "/maui/5/1/15.png", "/maui/4/15/7.png?size=512"}) {
    const Result<TileRequest> tile = find(there);
    ASSERT_TRUE(tile) << there << tile.error().message;
    EXPECT_EQ(tile->format, TileFormat::kHeightPng);
    EXPECT_EQ(tile->coding, Coding::kIdentity) << "PNG is compressed already";
  }
  EXPECT_EQ(find("/maui/4/15/7.png?size=512")->height_size, 512);
  for (const char* missing : {"/maui/1/0/1.png", "/maui/5/16/14.png", "/maui/5/31/20.png", "/maui/6/63/29.png",
                              "/maui/5/31/14.png?size=512", "/nope/0/0/0.png"}) {
    const Result<TileRequest> tile = find(missing);
    ASSERT_FALSE(tile) << missing;
    EXPECT_EQ(tile.error().code, ErrorCode::kNotFound) << missing;
  }
  EXPECT_EQ(find("/maui/0/0/0.png?size=3").error().code, ErrorCode::kInvalidArgument);
}

TEST(Negotiate, MakesACanonicalRequest) {
  std::array<DatasetView, 2> datasets;
  datasets[0].name = "etopo";
  datasets[1].name = "maui";
  datasets[1].available = {{{0, 0, 1, 0}}, {{0, 0, 1, 1}}};
  Request request;
  request.accept_encoding = "gzip";
  request.accept = "a/b;extensions=octvertexnormals";
  const auto negotiate = [&](const char* target) { return Negotiate(*Match(target), request, datasets); };

  const Result<TileRequest> tile = negotiate("/maui/1/1/0.terrain?v=3&error=100");
  ASSERT_TRUE(tile);
  EXPECT_EQ(tile->dataset, 1u);
  EXPECT_EQ(tile->key, (geo::TileKey{1, 1, 0}));
  EXPECT_EQ(tile->coding, Coding::kGzip);
  EXPECT_TRUE(tile->normals);
  EXPECT_EQ(tile->error_step, geo::SnapToLadder(1, 100));

  EXPECT_EQ(negotiate("/oahu/0/0/0.terrain").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(negotiate("/maui/1/2/0.terrain").error().code, ErrorCode::kNotFound) << "outside what it has";
  EXPECT_EQ(negotiate("/maui/2/0/0.terrain").error().code, ErrorCode::kNotFound) << "deeper than it goes";
  EXPECT_EQ(negotiate("/etopo/0/0/0.terrain").error().code, ErrorCode::kNotFound) << "has no tiles at all";
  EXPECT_EQ(negotiate("/maui/0/0/0.terrain?error=nan").error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace terrace::server

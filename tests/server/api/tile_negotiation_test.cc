#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <string>

#include "engine/geo/error_ladder.h"
#include "proto/mesh/skirt.h"
#include "server/api/tile_formats.h"
#include "server/query/tile_query.h"
#include "tests/server/test_context.h"

namespace terrace::server {
namespace {

TEST(NegotiateTile, ChoosesTheCodingByQuality) {
  const struct {
    const char* accept_encoding;
    tiler::Coding coding;
  } cases[] = {
      {"", tiler::Coding::kIdentity},
      {"gzip", tiler::Coding::kGzip},
      {"GZIP", tiler::Coding::kGzip},
      {"x-gzip", tiler::Coding::kGzip},
      {"gzip, deflate, br, zstd", tiler::Coding::kBrotli},
      {"gzip, deflate, zstd", tiler::Coding::kGzip},
      {"zstd", tiler::Coding::kZstd},
      {"gzip, deflate", tiler::Coding::kGzip},
      {"deflate, br", tiler::Coding::kBrotli},
      {"gzip, br;q=0.9", tiler::Coding::kGzip},
      {"br;q=0, *", tiler::Coding::kGzip},
      {"BR;q=0.5, identity;q=0.6", tiler::Coding::kIdentity},
      {"identity", tiler::Coding::kIdentity},
      {"*", tiler::Coding::kBrotli},
      {"*;q=0", tiler::Coding::kIdentity},
      {"gzip;q=0", tiler::Coding::kIdentity},
      {"gzip;q=0.000, *", tiler::Coding::kBrotli},
      {"gzip; q=0.5", tiler::Coding::kGzip},
      {"gzip;q=0.5, identity;q=0.9", tiler::Coding::kIdentity},
      {"identity;q=0.5, gzip;q=0.9", tiler::Coding::kGzip},
      {"gzip;q=1, identity;q=1", tiler::Coding::kGzip},
      {"identity;q=0", tiler::Coding::kIdentity},  // no coding is acceptable: plain bytes are better than none
      {"gzip;q=abc", tiler::Coding::kIdentity},
      {"gzip;q=2", tiler::Coding::kIdentity},
      {"gzip;q=nan", tiler::Coding::kIdentity},
      {",,, gzip ,;;", tiler::Coding::kGzip},
      {"gzipped", tiler::Coding::kIdentity},
  };
  for (const auto& c : cases) EXPECT_EQ(NegotiateCoding(c.accept_encoding), c.coding) << c.accept_encoding;
}

TEST(NegotiateTile, ChoosesAmongWhatIsOffered) {
  EXPECT_EQ(NegotiateCoding("gzip, br, zstd", tiler::kGzipOnly), tiler::Coding::kGzip);
  EXPECT_EQ(NegotiateCoding("br, zstd", tiler::kGzipOnly), tiler::Coding::kIdentity);
  EXPECT_EQ(NegotiateCoding("gzip, br", {}), tiler::Coding::kIdentity);
}

TEST(NegotiateTile, FindsExtensionsWhereverClientsAskForThem) {
  const proto::TileExtensions none, normals{true, false, false}, metadata{false, false, true},
      normals_metadata{true, false, true}, all{true, true, true};
  const struct {
    const char* accept;
    std::vector<std::string> query;
    proto::TileExtensions wanted;
  } cases[] = {
      {"", {}, none},
      {"*/*", {}, none},
      {"application/vnd.quantized-mesh,application/octet-stream;q=0.9,*/*;q=0.01", {}, none},
      // CesiumJS
      {"application/vnd.quantized-mesh;extensions=octvertexnormals-watermask-metadata,application/octet-stream;q=0.9,*/"
       "*;q=0.01",
       {},
       all},
      {"application/vnd.quantized-mesh;extensions=metadata,application/octet-stream;q=0.9", {}, metadata},
      // 3DTilesRendererJS
      {"application/vnd.quantized-mesh,application/octet-stream;q=0.9;extensions=octvertexnormals-metadata",
       {},
       normals_metadata},
      // cesium-native
      {"", {"octvertexnormals-metadata"}, normals_metadata},
      {"*/*", {"metadata", "watermask-octvertexnormals"}, all},
      {"a/b;extensions=octvertexnormals", {"watermask-metadata"}, all},
      {"", {"octvertexnormalsx"}, none},
      {"a/b; Extensions=\"octvertexnormals\"", {}, normals},
      {"a/b;extensions=", {""}, none},
      {"a/b;xextensions=octvertexnormals", {}, none},
  };
  for (const auto& c : cases) EXPECT_EQ(WantedExtensions(c.accept, c.query), c.wanted) << c.accept;
}

TEST(NegotiateTile, GivesNoExtensionThatTheTileHasNot) {
  std::array<DatasetView, 2> datasets;
  datasets[0].name = "dry";
  datasets[1].name = "wet";
  datasets[1].has_water = true;
  datasets[1].metadata_availability = 2;
  datasets[1].error_scale.max_source_level = 2;
  for (DatasetView& dataset : datasets) dataset.available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 7, 3}}};
  Request request;
  request.fields.Set(&RequestFields::accept, "a/b;extensions=octvertexnormals-watermask-metadata");
  const auto extensions = [&](const char* target) {
    const tiler::TileRequest tile = *NegotiateTile(TestContext(target, request).context, datasets);
    return tile.extensions;
  };
  EXPECT_EQ(extensions("/dry/0/0/0.terrain"), (proto::TileExtensions{true, false, false}));
  EXPECT_EQ(extensions("/wet/0/0/0.terrain"), (proto::TileExtensions{true, true, true}));
  EXPECT_EQ(extensions("/wet/1/0/0.terrain"), (proto::TileExtensions{true, true, false})) << "between two levels";
  EXPECT_EQ(extensions("/wet/2/0/0.terrain"), (proto::TileExtensions{true, true, false})) << "nothing is below";
  request.fields.Set(&RequestFields::accept, "");
  EXPECT_EQ(extensions("/wet/0/0/0.terrain"), proto::TileExtensions{});
}

geo::RequestedError Requested(std::optional<double> error_m, bool at_least = false,
                              std::optional<double> fraction = {}) {
  geo::RequestedError requested;
  requested.error_m = error_m;
  requested.at_least = at_least;
  requested.fraction = fraction;
  return requested;
}

TEST(NegotiateTile, PutsErrorsOnTheLadder) {
  const double d = geo::DefaultError(10);
  EXPECT_EQ(geo::ErrorStep(Requested({}), 10, {}), 0);
  EXPECT_EQ(geo::ErrorStep(Requested(d), 10, {}), 0);
  EXPECT_EQ(geo::ErrorStep(Requested(d * 0.99), 10, {}), 1) << "down, never up";
  EXPECT_EQ(geo::ErrorStep(Requested(d / 2), 10, {}), 4);
  EXPECT_EQ(geo::ErrorStep(Requested(d * 4), 10, {}), -8);
  EXPECT_EQ(geo::ErrorStep(Requested(1e308), 24, {}), geo::kCoarsestStep);
  EXPECT_EQ(geo::ErrorStep(Requested(5e-324), 0, {}), geo::kFinestStep);
}

TEST(NegotiateTile, AtLeastNeverGoesBelowTheDefault) {
  const double d = geo::DefaultError(10);
  EXPECT_EQ(geo::ErrorStep(Requested(d / 8, true), 10, {}), 0);
  EXPECT_EQ(geo::ErrorStep(Requested(d * 2, true), 10, {}), -4);
}

// No finer level follows the deepest one, so without this rule layer.json?error=E would never show E. A tile of another
// level without children is not at the deepest level: clients stop there because of availability, and its neighbours go
// deeper.
TEST(NegotiateTile, AtLeastGivesTheErrorAskedForAtTheDeepestLevel) {
  std::array<DatasetView, 1> datasets;
  datasets[0].name = "maui";
  datasets[0].available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 1, 1}}};
  datasets[0].error_scale.max_source_level = 2;
  const auto error = [&](const std::string& target) {
    const Result<tiler::TileRequest> tile = NegotiateTile(TestContext(target).context, datasets);
    EXPECT_TRUE(tile) << target;
    return tile ? geo::LadderError(tile->key.level, tile->error_step) : 0;
  };
  for (const std::string format : {".terrain", ".glb"}) {
    EXPECT_LE(error("/maui/2/0/0" + format + "?error=500&atleast=1"), 500);
    EXPECT_GT(error("/maui/2/0/0" + format + "?error=500&atleast=1"), 420) << "not finer than the ladder makes it";
    EXPECT_EQ(error("/maui/2/0/0" + format + "?error=500&atleast=1"), error("/maui/2/0/0" + format + "?error=500"));
    EXPECT_EQ(error("/maui/1/0/0" + format + "?error=500&atleast=1"), geo::DefaultError(1));
    EXPECT_EQ(error("/maui/1/3/1" + format + "?error=500&atleast=1"), geo::DefaultError(1)) << "without children";
    EXPECT_EQ(error("/maui/2/0/0" + format + "?error=20000&atleast=1"), error("/maui/2/0/0" + format + "?error=20000"));
  }
}

TEST(NegotiateTile, AFractionScalesEveryLevelAlike) {
  for (int level = 0; level <= 20; ++level) {
    EXPECT_EQ(geo::ErrorStep(Requested({}, false, 0.5), level, {}), 0);
    EXPECT_EQ(geo::ErrorStep(Requested({}, false, 0.25), level, {}), 4);
    EXPECT_EQ(geo::ErrorStep(Requested({}, false, 0.25), level, {.fraction = 0.25}), 0);
  }
  EXPECT_EQ(geo::ErrorStep(Requested({}, false, 1e308), 0, {}), geo::kCoarsestStep) << "the product overflows";
  EXPECT_EQ(geo::ErrorStep(Requested({}, false, 5e-324), 24, {}), geo::kFinestStep) << "the product underflows";
}

// A million requested errors must not make a million cache entries.
TEST(NegotiateTile, ComesToFortyOneErrorsAtMost) {
  constexpr int kErrors = 1'000'000;
  std::set<int> steps;
  for (int i = 0; i < kErrors; ++i)
    steps.insert(geo::ErrorStep(Requested(std::exp2(-400 + 800.0 * i / kErrors)), 7, {}));
  for (int i = 0; i < kErrors; ++i) steps.insert(geo::ErrorStep(Requested(i * 0.01 + 0.003), 7, {}));
  EXPECT_EQ(*steps.begin(), geo::kCoarsestStep);
  EXPECT_EQ(*steps.rbegin(), geo::kFinestStep);
  RecordProperty("errors", 2 * kErrors);
  RecordProperty("steps",
                 static_cast<int>(steps.size()));  // 41, because steps are all whole numbers between the ends
}

TEST(NegotiateTile, HeightTilesAreThoseThatMeetTheBounds) {
  std::array<DatasetView, 1> datasets;
  datasets[0].name = "maui";
  datasets[0].bounds = {170, 10, -160, 20};  // across the antimeridian
  datasets[0].max_mercator_depth = 5;
  const auto find = [&](const char* target) {
    Request request;
    request.fields.Set(&RequestFields::accept_encoding, "gzip");
    return NegotiateTile(TestContext(target, request).context, datasets);
  };
  for (const char* there : {"/maui/0/0/0.png", "/maui/1/0/0.png", "/maui/1/1/0.png", "/maui/5/31/14.png",
                            "/maui/5/1/15.png", "/maui/4/15/7.png?size=512"}) {
    const Result<tiler::TileRequest> tile = find(there);
    ASSERT_TRUE(tile) << there << tile.error().message;
    EXPECT_EQ(tile->format, tiler::TileFormat::kHeightPng);
    EXPECT_EQ(tile->coding, tiler::Coding::kIdentity) << "PNG is compressed already";
  }
  EXPECT_EQ(find("/maui/4/15/7.png?size=512")->side_px, 512);
  for (const char* missing : {"/maui/1/0/1.png", "/maui/5/16/14.png", "/maui/5/31/20.png", "/maui/6/63/29.png",
                              "/maui/5/31/14.png?size=512", "/nope/0/0/0.png"}) {
    const Result<tiler::TileRequest> tile = find(missing);
    ASSERT_FALSE(tile) << missing;
    EXPECT_EQ(tile.error().code, ErrorCode::kNotFound) << missing;
  }
  EXPECT_EQ(find("/maui/0/0/0.png?size=3").error().code, ErrorCode::kInvalidArgument);
}

TEST(NegotiateTile, MapTilesAreCanonical) {
  std::array<DatasetView, 2> datasets;
  datasets[0].name = "maui";
  datasets[0].max_mercator_depth = 12;
  datasets[1] = datasets[0];
  datasets[1].name = "photo";
  datasets[1].imagery = dem::ImageExtent{{170, 10, -160, 20}, 5, 4};
  const auto find = [&](const char* target) {
    Request request;
    request.fields.Set(&RequestFields::accept_encoding, "gzip");
    return NegotiateTile(TestContext(target, request).context, datasets);
  };
  const auto same = [&](const char* a, const char* b) {
    const auto one = find(a), other = find(b);
    EXPECT_TRUE(one && other) << a;
    return one && other && *one == *other;
  };
  EXPECT_TRUE(same("/maui/hillshade/3/1/1.png",
                   "/maui/hillshade/3/1/1.png?azimuth=315&altitude=45&zfactor=1.001&size=256&v=1"));
  EXPECT_TRUE(same("/maui/hillshade/3/1/1.png?azimuth=0", "/maui/hillshade/3/1/1.png?azimuth=360"));
  EXPECT_FALSE(same("/maui/hillshade/3/1/1.png", "/maui/hillshade/3/1/1.webp"));
  EXPECT_TRUE(same("/maui/slope/3/1/1.png", "/maui/slope/3/1/1.png?style=colors"));
  EXPECT_TRUE(same("/maui/contours/12/1/1.mvt", "/maui/contours/12/1/1.mvt?interval=50"));
  EXPECT_EQ(find("/maui/contours/12/1/1.mvt")->coding, tiler::Coding::kGzip);
  EXPECT_EQ(find("/maui/hillshade/3/1/1.png")->coding, tiler::Coding::kIdentity);
  EXPECT_EQ(find("/maui/contours/12/1/1.mvt?interval=2.5")->map.interval_cm, 250u);
  EXPECT_EQ(find("/maui/hillshade/3/1/1.png?zfactor=0.01")->map.z_factor_hundredths, 1u);
  EXPECT_EQ(find("/maui/hillshade/3/1/1.png?zfactor=100")->map.z_factor_hundredths, 10'000u);
  for (const char* wrong :
       {"/maui/contours/12/1/1.mvt?interval=2.4", "/maui/contours/12/1/1.mvt?interval=0.04",
        "/maui/contours/12/1/1.mvt?interval=10001", "/maui/contours/12/1/1.mvt?interval=nan",
        "/maui/contours/12/1/1.mvt?size=512", "/maui/hillshade/3/1/1.png?azimuth=-1",
        "/maui/hillshade/3/1/1.png?azimuth=1.5", "/maui/hillshade/3/1/1.png?zfactor=0.004",
        "/maui/hillshade/3/1/1.png?zfactor=0.0099", "/maui/hillshade/3/1/1.png?zfactor=100.001",
        "/maui/hillshade/3/1/1.png?zfactor=1e300", "/maui/hillshade/3/1/1.png?format=png",
        "/maui/slope/3/1/1.png?style=degrees&style=degrees", "/photo/imagery/0/0/0.jpg?quality=9"}) {
    const auto tile = find(wrong);
    ASSERT_FALSE(tile) << wrong;
    EXPECT_EQ(tile.error().code, ErrorCode::kInvalidArgument) << wrong;
  }
  for (const char* there :
       {"/photo/imagery/5/31/14.webp", "/photo/imagery/5/1/15.jpg", "/photo/imagery/4/15/7.jpg?size=512",
        "/photo/imagery/geodetic/4/31/9.webp", "/photo/imagery/geodetic/4/0/9.webp", "/photo/hillshade/12/5/5.png"}) {
    const auto tile = find(there);
    EXPECT_TRUE(tile) << there;
  }
  for (const char* missing :
       {"/photo/imagery/5/16/14.webp", "/photo/imagery/6/63/29.webp", "/photo/imagery/5/31/14.webp?size=512",
        "/photo/imagery/geodetic/4/16/9.webp", "/photo/imagery/geodetic/5/63/19.webp", "/maui/imagery/0/0/0.webp",
        "/maui/imagery/geodetic/0/0/0.webp", "/maui/hillshade/13/5/5.png", "/maui/hillshade/12/5/5.png?size=512"}) {
    const auto tile = find(missing);
    ASSERT_FALSE(tile) << missing;
    EXPECT_EQ(tile.error().code, ErrorCode::kNotFound) << missing;
  }
}

TEST(NegotiateTile, MakesACanonicalRequest) {
  std::array<DatasetView, 2> datasets;
  datasets[0].name = "etopo";
  datasets[1].name = "maui";
  datasets[1].available = {{{0, 0, 1, 0}}, {{0, 0, 1, 1}}};
  Request request;
  request.fields.Set(&RequestFields::accept_encoding, "gzip");
  request.fields.Set(&RequestFields::accept, "a/b;extensions=octvertexnormals");
  const auto negotiate = [&](const char* target) {
    return NegotiateTile(TestContext(target, request).context, datasets);
  };

  const Result<tiler::TileRequest> tile = negotiate("/maui/1/1/0.terrain?v=3&error=100");
  ASSERT_TRUE(tile);
  EXPECT_EQ(tile->dataset, 1u);
  EXPECT_EQ(tile->key, (geo::TileKey{1, 1, 0}));
  EXPECT_EQ(tile->coding, tiler::Coding::kGzip);
  EXPECT_TRUE(tile->extensions.normals);
  EXPECT_EQ(tile->error_step, geo::SnapToLadder(1, 100));

  EXPECT_EQ(negotiate("/oahu/0/0/0.terrain").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(negotiate("/maui/1/2/0.terrain").error().code, ErrorCode::kNotFound) << "outside what it has";
  EXPECT_EQ(negotiate("/maui/2/0/0.terrain").error().code, ErrorCode::kNotFound) << "deeper than it goes";
  EXPECT_EQ(negotiate("/etopo/0/0/0.terrain").error().code, ErrorCode::kNotFound) << "has no tiles at all";
  EXPECT_EQ(negotiate("/maui/0/0/0.terrain?error=nan").error().code, ErrorCode::kInvalidArgument);
}

TEST(NegotiateTile, GlbTilesAreCanonicalToo) {
  DatasetView view;
  view.name = "maui";
  view.available = {{{0, 0, 1, 0}}};
  view.glb_compression = proto::GlbCompression::kMeshopt;
  const std::vector<DatasetView> datasets = {view};
  Request request;
  request.fields.Set(&RequestFields::accept_encoding, "gzip");
  request.fields.Set(&RequestFields::accept, "a/b;extensions=octvertexnormals");
  const auto negotiate = [&](const char* target) {
    return NegotiateTile(TestContext(target, request).context, datasets);
  };

  const Result<tiler::TileRequest> tile = negotiate("/maui/0/1/0.glb?extensions=octvertexnormals-metadata");
  ASSERT_TRUE(tile);
  EXPECT_EQ(tile->format, tiler::TileFormat::kGlb);
  EXPECT_EQ(tile->compression, proto::GlbCompression::kMeshopt);
  EXPECT_FALSE(tile->extensions.normals) << "they have normals whatever is asked for";
  EXPECT_EQ(*tile, *negotiate("/maui/0/1/0.glb?compression=meshopt"));
  EXPECT_FALSE(*tile == *negotiate("/maui/0/1/0.glb?compression=draco"));
  EXPECT_EQ(negotiate("/maui/0/1/0.glb?compression=draco")->coding, tiler::Coding::kIdentity);
  EXPECT_EQ(tile->coding, tiler::Coding::kGzip);
  EXPECT_EQ(negotiate("/maui/0/1/0.glb?compression=none")->coding, tiler::Coding::kGzip);
  EXPECT_EQ(negotiate("/maui/0/1/0.glb?compression=quantized")->coding, tiler::Coding::kGzip);
  EXPECT_EQ(negotiate("/maui/0/1/0.glb?compression=zip").error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(negotiate("/maui/0/1/0.terrain?compression=none").error().code, ErrorCode::kInvalidArgument);
  // The dataset's option for GLB tiles makes no second variant of other tiles.
  EXPECT_EQ(negotiate("/maui/0/1/0.terrain")->compression, tiler::TileRequest{}.compression);
}

// Skirts require this (proto/mesh/skirt.h): for any request, a parent's error is at most twice the error for which they
// are made.
TEST(NegotiateTile, AParentIsAtMostTwiceAsCoarse) {
  for (int level = 1; level <= geo::kMaxLevel; ++level) {
    for (double error_m = 1e-5; error_m < 1e8; error_m *= 1.31) {
      for (const geo::RequestedError& requested :
           {geo::RequestedError{error_m, {}, false}, geo::RequestedError{error_m, {}, true},
            geo::RequestedError{{}, error_m / 1000, false}, geo::RequestedError{}}) {
        const auto error = [&](int at) {
          return geo::LadderError(at, geo::ErrorStep(requested, at, {.max_source_level = geo::kMaxLevel + 1}), 0.5);
        };
        EXPECT_LE(error(level - 1), 2 * error(level) * (1 + 1e-12)) << level << ", " << error_m;
        const double skirt =
            proto::SkirtError(level, geo::ErrorStep(requested, level, {.max_source_level = level}), true, 0.5);
        EXPECT_LE(error(level - 1), 2 * skirt * (1 + 1e-12)) << "deepest: " << level << ", " << error_m;
      }
    }
  }
}

TEST(NegotiateTile, GivesATextureOnlyToGlbTilesOfDatasetsWithImagery) {
  std::array<DatasetView, 2> datasets;
  datasets[0].name = "bare";
  datasets[1].name = "photo";
  datasets[1].texture = proto::TextureFormat::kJpeg;
  for (DatasetView& dataset : datasets) dataset.available = {{{0, 0, 1, 0}}};
  const auto texture = [&](const char* target) {
    return NegotiateTile(TestContext(target).context, datasets)->texture;
  };
  EXPECT_EQ(texture("/bare/0/0/0.glb"), proto::TextureFormat::kNone);
  EXPECT_EQ(texture("/bare/0/0/0.glb?texture=webp"), proto::TextureFormat::kNone);
  EXPECT_EQ(texture("/photo/0/0/0.glb"), proto::TextureFormat::kJpeg);
  EXPECT_EQ(texture("/photo/0/0/0.glb?texture=webp"), proto::TextureFormat::kWebp);
  EXPECT_EQ(texture("/photo/0/0/0.glb?texture=none"), proto::TextureFormat::kNone);
  EXPECT_EQ(texture("/photo/0/0/0.terrain"), proto::TextureFormat::kNone);
}

}  // namespace
}  // namespace terrace::server

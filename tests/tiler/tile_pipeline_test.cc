// The whole path of a worker on the sample data: the promises of the README about errors and cracks, measured on
// decoded bytes.
#include "tiler/tile_pipeline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "engine/geo/error_ladder.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/support/scratch_directory.h"
#include "tests/tiler/fetched_tile.h"
#include "tiler/tile/check_request.h"

namespace terrace::tiler {
namespace {

FetchedTile Fetch(std::uint32_t dataset, geo::TileKey key, int step) {
  TileRequest request;
  request.dataset = dataset;
  request.key = key;
  request.error_step = step;
  return FetchTile(SamplePipeline(), request);
}

geo::TileKey MiddleTile(std::uint32_t dataset, int level) {
  const geo::TileRange& range = SamplePipeline().datasets()[dataset].model->Available(level).front();
  return {level, (range.start_x + range.end_x) / 2, (range.start_y + range.end_y) / 2};
}

TEST(TilePipeline, NeighboursDecodeTheSameEdges) {
  for (const std::uint32_t dataset : {0u, 1u}) {
    for (const int step : {-8, 0, 6, 12, 24}) {
      for (int level = 1; level <= SamplePipeline().datasets()[dataset].model->max_level(); level += 2) {
        const geo::TileKey key = MiddleTile(dataset, level);
        const FetchedTile tile = Fetch(dataset, key, step);
        const geo::TileKey east = geo::Neighbour(key, 1, 0), north = geo::Neighbour(key, 0, 1);
        if (SamplePipeline().datasets()[dataset].model->IsAvailable(east)) {
          EXPECT_EQ(EdgeOf(tile, true, 32767), EdgeOf(Fetch(dataset, east, step), true, 0))
              << geo::ToString(key) << " step " << step;
        }
        if (SamplePipeline().datasets()[dataset].model->IsAvailable(north)) {
          EXPECT_EQ(EdgeOf(tile, false, 32767), EdgeOf(Fetch(dataset, north, step), false, 0))
              << geo::ToString(key) << " step " << step;
        }
      }
    }
  }
}

TEST(TilePipeline, MatchesAcrossTheAntimeridianAndAtThePoles) {
  for (const int level : {0, 1, 3, 5}) {
    for (const std::int64_t y : {std::int64_t{0}, geo::TileRows(level) / 2, geo::TileRows(level) - 1}) {
      const geo::TileKey west{level, geo::TileColumns(level) - 1, y}, east{level, 0, y};
      EXPECT_EQ(EdgeOf(Fetch(0, west, 0), true, 32767), EdgeOf(Fetch(0, east, 0), true, 0)) << level << "/" << y;
    }
  }
}

TEST(TilePipeline, ReachesTheLadderError) {
  for (const std::uint32_t dataset : {0u, 1u}) {
    for (const int step : {-8, 0, 8}) {
      for (int level = 0; level <= SamplePipeline().datasets()[dataset].model->max_level(); ++level) {
        const FetchedTile tile = Fetch(dataset, MiddleTile(dataset, level), step);
        // Heights are rounded to 2^-10 m, so the error may be half of that larger.
        EXPECT_LE(tile.encoded.max_error_m + 0x1p-11, geo::LadderError(level, step))
            << dataset << " level " << level << " step " << step;
      }
    }
  }
}

TEST(TilePipeline, GivesTheSameBytesOnEveryThread) {
  const geo::TileKey key = MiddleTile(1, 11);
  const EncodedTile expected = Fetch(1, key, 4).encoded;
  std::vector<std::thread> threads;
  for (int k = 0; k < 4; ++k) {
    threads.emplace_back([&] { EXPECT_EQ(Fetch(1, key, 4).encoded.bytes, expected.bytes); });
  }
  for (std::thread& thread : threads) thread.join();
}

// For every criterion, neighbours at every error match and keep the error.
TEST(TilePipeline, KeepsErrorsAndEdgesByEveryRule) {
  for (const tin::Criterion criterion : {tin::Criterion::kDelaunay, tin::Criterion::kDataDependent}) {
    for (const bool compact : {false, true}) {
      if (criterion == tin::Criterion::kDelaunay && !compact) continue;
      std::vector<Dataset> datasets;
      datasets.push_back(OpenSample("jacksboro"));
      datasets.back().mesh_options = {criterion, compact};
      const TilePipeline pipeline(std::move(datasets));
      for (const int level : {7, 10, 12}) {
        for (const int step : {0, 10}) {
          TileRequest request;
          request.key = MiddleTile(1, level);
          request.error_step = step;
          const auto tile = pipeline.Build(request, {});
          ASSERT_TRUE(tile.has_value()) << tile.error().message;
          EXPECT_LE(tile->max_error_m, geo::LadderError(level, step));
          const FetchedTile plain = Fetch(1, request.key, step);
          if (plain.encoded.vertices > 500) {
            EXPECT_LT(tile->vertices, plain.encoded.vertices) << level << " step " << step;
          }
          // Edges do not depend on how the inside is meshed.
          const FetchedTile fetched = FetchTile(pipeline, request);
          for (const bool vertical : {true, false}) {
            EXPECT_EQ(EdgeOf(fetched, vertical, 0), EdgeOf(plain, vertical, 0));
            EXPECT_EQ(EdgeOf(fetched, vertical, 32767), EdgeOf(plain, vertical, 32767));
          }
        }
      }
    }
  }
}

// The cached refinement serves coarser errors, is continued for finer ones, and does not change bytes.
TEST(TilePipeline, GivesTheSameBytesFromScratchFromReplayAndContinued) {
  const auto open = [](std::size_t cache_bytes) {
    std::vector<Dataset> datasets;
    datasets.push_back(OpenSample("etopo5"));
    datasets.push_back(OpenSample("jacksboro"));
    return std::make_unique<TilePipeline>(std::move(datasets), cache_bytes);
  };
  const auto scratch = open(0), cached = open(std::size_t{64} << 20);
  for (const std::uint32_t dataset : {0u, 1u}) {
    for (int level = 0; level <= SamplePipeline().datasets()[dataset].model->max_level(); level += 3) {
      TileRequest request;
      request.dataset = dataset;
      request.key = MiddleTile(dataset, level);
      for (const int step : {0, 8, 4, 20, -6, 24}) {
        request.error_step = step;
        const auto expected = scratch->Build(request, {}), tile = cached->Build(request, {});
        ASSERT_TRUE(expected.has_value() && tile.has_value());
        ASSERT_EQ(tile->bytes, expected->bytes) << dataset << "/" << geo::ToString(request.key) << " step " << step;
        ASSERT_EQ(tile->max_error_m, expected->max_error_m);
      }
      // All of these are made from one read.
      request.coding = Coding::kGzip;
      request.extensions.normals = true;
      EXPECT_EQ(cached->Build(request, {})->times.read.count(), 0);
    }
  }
  EXPECT_EQ(scratch->refinements().entries, 0u);
  EXPECT_GT(cached->refinements().entries, 5u);
}

// As embedders make datasets (examples/embed): the cache of refinements must not take one for the other.
TEST(TilePipeline, KeepsDatasetsWithoutAGenerationApart) {
  std::vector<Dataset> datasets;
  for (const char* const name : {"etopo5", "jacksboro"}) {
    datasets.push_back(OpenSample(name));
    datasets.back().generation = 0;
  }
  const TilePipeline pipeline(std::move(datasets));
  TileRequest request;
  request.key = {3, MiddleTile(1, 3).x, MiddleTile(1, 3).y};
  for (const std::uint32_t dataset : {0u, 1u}) {
    request.dataset = dataset;
    EXPECT_EQ(FetchTile(pipeline, request).encoded.bytes, Fetch(dataset, request.key, 0).encoded.bytes) << dataset;
  }
}

// A raster on the lattice of level 5: cliffs in tile 32/16, flat ground east of it.
std::unique_ptr<dem::ElevationModel> OpenCliffs(const std::filesystem::path& folder) {
  constexpr double kStep = 5.625 / 256;
  constexpr int kColumns = 516, kRows = 260;
  const std::string path = folder / "cliffs.img";
  std::vector<float> heights;
  std::uint32_t state = 1;
  for (int j = 0; j < kRows; ++j) {
    for (int i = 0; i < kColumns; ++i) {
      state = state * 1664525 + 1013904223;
      heights.push_back(i >= 1 && i < 257 ? static_cast<float>(state >> 18) : 0);
    }
  }
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(heights.data()),
             static_cast<std::streamsize>(heights.size() * sizeof(float)));
  std::ofstream(folder / "cliffs.hdr")
      << "ENVI\nsamples = " << kColumns << "\nlines = " << kRows
      << "\nbands = 1\ndata type = 4\ninterleave = bsq\nbyte order = 0\nmap info = {Geographic Lat/Lon, 1, 1, "
      << std::setprecision(17) << -1.5 * kStep << ", " << 5.625 + 1.5 * kStep << ", " << kStep << ", " << kStep
      << ", WGS-84}\n";
  auto source = dem::ElevationModel::Open(path);
  EXPECT_TRUE(source.has_value()) << (source ? "" : source.error().message);
  return source ? *std::move(source) : nullptr;
}

// The seeds on an edge are those of the requested error, even if the inside must be coarser.
TEST(TilePipeline, MatchesEdgesOfTilesThatTheFormatCannotHold) {
  const test_support::ScratchDirectory scratch;
  std::vector<Dataset> datasets(1);
  datasets[0].model = OpenCliffs(scratch.path());
  ASSERT_NE(datasets[0].model, nullptr);
  const TilePipeline pipeline(std::move(datasets));
  TileRequest request;
  request.error_step = 24;
  request.extensions.normals = true;
  Edge edges[2];
  for (const int k : {0, 1}) {
    request.key = {5, 32 + k, 16};
    const auto tile = pipeline.Build(request, {});
    ASSERT_TRUE(tile.has_value()) << tile.error().message;
    if (k == 0) {
      EXPECT_GT(tile->max_error_m, geo::LadderError(5, 24));  // otherwise this tests nothing
    }
    edges[k] = EdgeOf({*proto::DecodeQuantizedMesh(tile->bytes), *tile}, true, k == 0 ? 32767 : 0);
  }
  EXPECT_GT(edges[0].size(), 2u);
  EXPECT_EQ(edges[0], edges[1]);
}

TEST(TilePipeline, RefusesWhatIsNotThere) {
  TileRequest request;
  request.dataset = 7;
  EXPECT_EQ(SamplePipeline().Build(request, {}).error().code, ErrorCode::kNotFound);
  request.dataset = 1;
  request.key = {13, 0, 0};
  EXPECT_EQ(SamplePipeline().Build(request, {}).error().code, ErrorCode::kNotFound);
}

TEST(TilePipeline, RefusesValuesThatRequestsMayNotHave) {
  const auto refusal = [](TileFormat format, auto&& change) {
    TileRequest request;
    request.format = format;
    request.key = {1, 1, 1};
    change(request);
    const auto tile = SamplePipeline().Build(request, {});
    return tile ? "a tile" : std::string(ToString(tile.error().code)) + " " + tile.error().message;
  };
  const auto begins = [](const std::string& text, const char* with) { EXPECT_EQ(text.rfind(with, 0), 0u) << text; };
  for (const TileFormat format : {TileFormat::kQuantizedMesh, TileFormat::kHeightPng, TileFormat::kHillshade,
                                  TileFormat::kSlope, TileFormat::kContours, TileFormat::kGeodeticImagery}) {
    for (const geo::TileKey& key : {geo::TileKey{-1, 0, 0}, {1, 4, 0}, {1, 0, 2}, {1, -1, 0}, {64, 0, 0}}) {
      begins(refusal(format, [&](TileRequest& request) { request.key = key; }), "not_found");
    }
  }
  for (const int step : {-17, 25}) {
    begins(refusal(TileFormat::kGlb, [&](TileRequest& request) { request.error_step = step; }),
           "invalid_argument error_step");
  }
  for (const int side : {0, -1, 100, 1024}) {
    begins(refusal(TileFormat::kHeightPng, [&](TileRequest& request) { request.side_px = side; }),
           "invalid_argument side_px");
  }
  begins(refusal(TileFormat::kContours, [](TileRequest&) {}), "invalid_argument interval_cm");
  begins(refusal(TileFormat::kHillshade, [](TileRequest& request) { request.map.azimuth_deg = 360; }),
         "invalid_argument azimuth_deg");
  begins(refusal(TileFormat::kHillshade, [](TileRequest& request) { request.map.z_factor_hundredths = 0; }),
         "invalid_argument azimuth_deg");
  begins(
      refusal(TileFormat::kHillshade, [](TileRequest& request) { request.map.picture = proto::PictureFormat::kJpeg; }),
      "invalid_argument picture");
  TileRequest deepest;  // with 512 pixels, those of a deeper grid
  deepest.format = TileFormat::kImagery;
  deepest.key.level = geo::kMaxLevel;
  EXPECT_TRUE(CheckRequest(deepest));
  deepest.side_px = 512;
  EXPECT_EQ(CheckRequest(deepest).error().code, ErrorCode::kNotFound);
}

TEST(TilePipeline, HasNoOtherDatasets) {
  const TilePipeline& pipeline = SamplePipeline();
  const auto number = static_cast<std::uint32_t>(pipeline.datasets().size());
  EXPECT_EQ(pipeline.ReadPoints(number, {}, dem::HeightDatum::kEllipsoid, {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(pipeline.ReadNormals(number, {}, {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(pipeline.ReadDrawnPoints(number, {}, {}, false, {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(pipeline.LookAlong(number, {}, {}, {}, {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(pipeline.PlanArea(number, {}, 1).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(pipeline.BuildArea(number, {}, {}, {}).error().code, ErrorCode::kNotFound);
}

// A plane on the map around the South Pole, which rises towards 90 degrees east.
TEST(TilePipeline, NormalsAtAPolePointIntoOneDirection) {
  const dem::TempDir dir;
  dem::RasterSpec spec{
      .width = 500, .height = 500, .geo_transform = {-1.25e6, 5000, 0, 1.25e6, 0, -5000}, .crs = "EPSG:3031"};
  spec.value = [](int column, int) { return 50.0 * column; };  // 0.01 of the map's metres
  const TilePipeline pipeline({OpenDataset("pole", dem::WriteRaster(dir, spec))});
  constexpr double kScale = 0.97276901;  // metres of the map in one on the ground, at the pole
  for (const double latitude : {-90.0, -89.995, -89.98, -89.5}) {
    std::vector<dem::GeoPosition> points;
    for (int longitude = -180; longitude <= 180; longitude += 15) points.push_back({double(longitude), latitude});
    const auto normals = pipeline.ReadNormals(0, points, {});
    ASSERT_TRUE(normals) << normals.error().message;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double meridian = points[i].longitude * std::numbers::pi / 180;
      EXPECT_NEAR((*normals)[i][0], -0.01 * kScale * std::cos(meridian), 3e-5)
          << points[i].longitude << ' ' << latitude;
      EXPECT_NEAR((*normals)[i][1], -0.01 * kScale * std::sin(meridian), 3e-5)
          << points[i].longitude << ' ' << latitude;
    }
  }
}

TEST(TilePipeline, DrawnPointsMayBeATurnAway) {
  const DrawnSurface surface;
  const std::vector<dem::GeoPosition> points = {{-84.2, 36.3}, {275.8, 36.3}, {-444.2, 36.3}};
  const auto heights = SamplePipeline().ReadDrawnPoints(0, surface, points, false, {});
  ASSERT_TRUE(heights) << heights.error().message;
  EXPECT_NEAR(heights->heights[1], heights->heights[0], 1e-3);
  EXPECT_NEAR(heights->heights[2], heights->heights[0], 1e-3);
  EXPECT_EQ(SamplePipeline().ReadDrawnPoints(0, {.level = -1}, points, false, {}).error().code,
            ErrorCode::kInvalidArgument);
}

TEST(TilePipeline, StopsWhenNobodyWaits) {
  std::stop_source stop;
  stop.request_stop();
  TileRequest request;
  request.dataset = 1;
  request.key = MiddleTile(1, 10);
  EXPECT_EQ(SamplePipeline().Build(request, stop.get_token()).error().code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace terrace::tiler

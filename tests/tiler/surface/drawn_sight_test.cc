// Lines of sight over the triangles of tiles, compared with heights of the same triangles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"
#include "tiler/surface/drawn_tiles.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

TilePipeline OpenOne(const dem::TempDir& dir, const dem::RasterSpec& spec) {
  Dataset dataset;
  dataset.name = "one";
  dataset.model = dem::OpenOrFail(dem::WriteRaster(dir, spec));
  dataset.generation = dataset.unedited_generation = dataset.model->fingerprint();
  std::vector<Dataset> datasets;
  datasets.push_back(std::move(dataset));
  return TilePipeline(std::move(datasets));
}

// One degree around a pole, with ridges along meridians.
dem::RasterSpec PolarRaster(bool is_north) {
  dem::RasterSpec spec{.width = 720, .height = 100, .geo_transform = {-180, .5, 0, is_north ? 90.0 : -89.0, 0, -.01}};
  spec.value = [is_north](int column, int row) {
    return 150 + 100 * std::sin(column / 720.0 * 4 * 3.14159) * (is_north ? row : 100 - row) / 100.0;
  };
  return spec;
}

// Of `kPlaces` places along the ray.
double LowestClearance(const TilePipeline& pipeline, const DrawnSurface& surface, const dem::SightRay& ray) {
  constexpr int kPlaces = 4000;
  std::vector<dem::GeoPosition> places;
  std::vector<double> ray_heights;
  for (int k = 0; k <= kPlaces; ++k) {
    const dem::SightPoint place = dem::PointAt(ray, static_cast<double>(k) / kPlaces, {});
    places.push_back({place.longitude, place.latitude});
    ray_heights.push_back(place.height_m);
  }
  const auto drawn = pipeline.ReadDrawnPoints(0, surface, places, /*normals=*/false, {});
  EXPECT_TRUE(drawn) << (drawn ? "" : drawn.error().message);
  double lowest = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; drawn && k < places.size(); ++k) {
    lowest = std::min(lowest, ray_heights[k] - static_cast<double>(drawn->heights[k]));
  }
  return lowest;
}

void ExpectAgreesWithHeights(const TilePipeline& pipeline, const DrawnSurface& surface, const dem::SightRay& ray,
                             double tolerance_m) {
  const auto answers = pipeline.LookAlong(0, surface, {&ray, 1}, {}, {});
  ASSERT_TRUE(answers) << answers.error().message;
  const dem::SightAnswer& answer = answers->front();
  const double lowest = LowestClearance(pipeline, surface, ray);
  // There may be a lower place between the places.
  EXPECT_LE(answer.clearance_m, lowest + 0.01);
  EXPECT_GE(answer.clearance_m, lowest - tolerance_m);
  EXPECT_EQ(answer.is_visible, answer.clearance_m >= -dem::kSightTolerance);
}

TEST(DrawnSight, AgreesWithHeightsNearPoles) {
  for (const bool is_north : {true, false}) {
    const dem::TempDir dir;
    const TilePipeline pipeline = OpenOne(dir, PolarRaster(is_north));
    std::mt19937 random(7);
    std::uniform_real_distribution<double> degrees(-180, 180), exponent(-4, -1.5), ahead(5, 170);
    for (int i = 0; i < 40; ++i) {
      const double longitude = degrees(random), latitude = (is_north ? 1 : -1) * (90 - std::pow(10, exponent(random)));
      const dem::SightRay ray{{longitude, latitude, 400},
                              {std::remainder(longitude + ahead(random), 360), latitude, 400}};
      SCOPED_TRACE(testing::Message() << longitude << " " << latitude << " to " << ray.to.longitude);
      ExpectAgreesWithHeights(pipeline, {6, {}, TileFormat::kQuantizedMesh, proto::GlbCompression::kDraco}, ray, 0.5);
    }
  }
}

// Half of the rays leave the raster, and there the tiles of deep levels.
TEST(DrawnSight, AgreesWithHeightsAcrossLevels) {
  const dem::TempDir dir;
  dem::RasterSpec spec{.width = 200, .height = 200, .geo_transform = {7, .001, 0, 46, 0, -.001}};
  spec.value = [](int column, int row) { return 500 + 300 * std::sin(column / 9.0) * std::cos(row / 7.0); };
  const TilePipeline pipeline = OpenOne(dir, spec);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> longitude(6.98, 7.22), latitude(45.78, 46.02), height(400, 1200);
  for (const int level : {5, 9, 12}) {
    for (int i = 0; i < 30; ++i) {
      const dem::SightRay ray{{longitude(random), latitude(random), height(random)},
                              {longitude(random), latitude(random), height(random)}};
      SCOPED_TRACE(testing::Message() << level << ": " << ray.from.longitude << " " << ray.from.latitude << " to "
                                      << ray.to.longitude << " " << ray.to.latitude);
      ExpectAgreesWithHeights(pipeline, {level, {}, TileFormat::kQuantizedMesh, proto::GlbCompression::kDraco}, ray,
                              40);
    }
  }
}

// Along a meridian between two tiles every place is on the edges of triangles.
TEST(DrawnSight, AgreesWithHeightsAlongTheEdgesOfTiles) {
  const dem::TempDir dir;
  dem::RasterSpec spec{.width = 200, .height = 200, .geo_transform = {11.15, .001, 0, 46, 0, -.001}};
  std::mt19937 random(5);
  std::uniform_real_distribution<double> height(0, 300), latitude(45.82, 45.98), along(0.002, 0.02);
  spec.value = [&](int, int) { return height(random); };
  const TilePipeline pipeline = OpenOne(dir, spec);
  for (const int level : {9, 12, 13}) {
    for (int i = 0; i < 10; ++i) {
      const double south = latitude(random);
      const dem::SightRay ray{{11.25, south, 320}, {11.25, south + along(random), 320}};
      SCOPED_TRACE(testing::Message() << level << ": " << south << " to " << ray.to.latitude);
      ExpectAgreesWithHeights(pipeline, {level, {}, TileFormat::kQuantizedMesh, proto::GlbCompression::kDraco}, ray,
                              0.5);
    }
  }
}

// The rays lie in the strips that flat triangles leave out north of an edge. There the southern tiles are read, too,
// but do not count.
TEST(DrawnSight, CountsTheTilesThatRaysLieIn) {
  const dem::TempDir dir;
  const dem::RasterSpec flat{
      .width = 4600, .height = 200, .geo_transform = {0, .005, 0, 45.5, 0, -.005}, .value = [](int, int) {
        return 5.0;
      }};
  const TilePipeline pipeline = OpenOne(dir, flat);
  std::vector<dem::SightRay> rays;
  for (std::size_t i = 0; i < kMaxTilesRead; ++i) {
    const double longitude = 0.06 + static_cast<double>(i) * 180 / 512;
    rays.push_back({{longitude, 45.000005, 10}, {longitude + 0.0001, 45.000005, 10}});
  }
  const DrawnSurface surface{9, {}, TileFormat::kQuantizedMesh, proto::GlbCompression::kDraco};
  const auto answers = pipeline.LookAlong(0, surface, rays, {}, {});
  EXPECT_TRUE(answers) << (answers ? "" : answers.error().message);
  rays.push_back({{22.7, 45.1, 10}, {22.7001, 45.1, 10}});
  EXPECT_FALSE(pipeline.LookAlong(0, surface, rays, {}, {}));
}

}  // namespace
}  // namespace terrace::tiler

#include <algorithm>

#include "engine/dem/planned_tiles.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

// Laws of availability: both roots; every ancestor of an available tile; four children or none; no overlaps.
void ExpectLawful(const ElevationModel& model) {
  EXPECT_TRUE(model.IsAvailable({0, 0, 0}) && model.IsAvailable({0, 1, 0}));
  EXPECT_TRUE(model.Available(model.max_level() + 1).empty());
  for (int level = 1; level <= model.max_level(); ++level) {
    for (const geo::TileRange& range : model.Available(level)) {
      for (const geo::TileKey& corner :
           {geo::TileKey{level, range.start_x, range.start_y}, {level, range.end_x, range.end_y}}) {
        EXPECT_TRUE(geo::IsValid(corner));
        EXPECT_TRUE(model.IsAvailable({level - 1, corner.x / 2, corner.y / 2}));
        // 3D Tiles clients replace a tile by its children: a missing one is a hole.
        for (const std::int64_t child : {0, 1, 2, 3}) {
          EXPECT_TRUE(model.IsAvailable({level, corner.x / 2 * 2 + child % 2, corner.y / 2 * 2 + child / 2}));
        }
        EXPECT_EQ(std::ranges::count_if(model.Available(level), [&](const auto& r) { return r.Contains(corner); }), 1);
      }
    }
  }
}

TEST(Footprint, IsLawfulForEveryKindOfCrs) {
  for (const std::string& name : RealRasters()) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    ExpectLawful(*source);
  }
}

TEST(Footprint, CrossesTheAntimeridianInTwoRanges) {
  TERRACE_REQUIRE_DATA(path, "antimeridian_hawaii_topobathy_5min.tif");
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  const GeoBounds bounds = source->info().bounds;
  EXPECT_NEAR(bounds.west, 159.7917, 1e-3);
  EXPECT_NEAR(bounds.east, -139.7917, 1e-3);
  // Level 4: tiles of 11.25 degrees.
  EXPECT_EQ(source->Available(4), (std::vector<geo::TileRange>{{0, 8, 3, 13}, {30, 8, 31, 13}}));
}

TEST(Footprint, OfAGlobalSourceIsTheWholeEarth) {
  for (const std::string name : {"etopo5_global_10min.tif", "etopo1_global_1deg_float32.tif"}) {
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      const geo::TileRange whole{0, 0, geo::TileColumns(level) - 1, geo::TileRows(level) - 1};
      EXPECT_EQ(source->Available(level), std::vector<geo::TileRange>{whole}) << name << " " << level;
    }
    EXPECT_EQ(source->info().bounds.west, -180);
    EXPECT_EQ(source->info().bounds.east, 180);
    EXPECT_EQ(source->info().bounds.north, 90);
  }
}

TEST(Footprint, AroundAPoleHasAllLongitudes) {
  TERRACE_REQUIRE_DATA(path, "pole_antarctica_bedmap_5km.tif");
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  const GeoBounds bounds = source->info().bounds;
  EXPECT_EQ(bounds.south, -90);
  EXPECT_EQ(bounds.west, -180);
  EXPECT_EQ(bounds.east, 180);
  EXPECT_NEAR(bounds.north, -48.46, .02);
  EXPECT_EQ(source->Available(4), (std::vector<geo::TileRange>{{0, 0, 31, 3}}));
}

// On a cylindrical map the pole is a line: a raster that ends near it keeps its extent.
TEST(Footprint, NearAPoleThatIsALineHasTheExtentOfTheRaster) {
  const TempDir dir;
  constexpr double kDegree = 20'037'508.342789244 / 180;  // of EPSG:4087, metres
  RasterSpec spec{.width = 400, .height = 80, .crs = "EPSG:4087"};
  spec.geo_transform = {-10 * kDegree, .05 * kDegree, 0, 89.95 * kDegree, 0, -.05 * kDegree};
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(source, nullptr);
  const GeoBounds bounds = source->info().bounds;
  EXPECT_NEAR(bounds.west, -10, .1);
  EXPECT_NEAR(bounds.east, 10, .1);
  EXPECT_NEAR(bounds.north, 89.95, .1);
}

TEST(Footprint, ReachesWhereverReadFindsHeights) {
  for (const std::string name :
       {"bigtujunga_30m_utm11.tif", "greenland_80N_100m_custom_tm.tif", "lidar_slovenia_1m_nodata.tif"}) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path, {.floor = -1000});
    ASSERT_NE(source, nullptr);
    const int level = source->max_level() - 3;
    const geo::TileRange range = source->Available(level).front();
    for (std::int64_t x = range.start_x - 1; x <= range.end_x + 1; ++x) {
      for (const std::int64_t y : {range.start_y - 1, range.end_y + 1}) {
        const auto tile = source->Read({level, x, y});
        ASSERT_TRUE(tile);
        for (int j = 1; j < tile->lattice.cells; ++j) {
          for (int i = 1; i < tile->lattice.cells; ++i) ASSERT_EQ(tile->At(i, j), -1000) << x << " " << y;
        }
      }
    }
  }
}

TEST(CommonBounds, StayWithinTheTurn) {
  const auto common = CommonBounds({173.9, -5, -172.1, 0}, {-180, -4, -173, -1});
  ASSERT_EQ(common.size(), 1u);
  EXPECT_EQ(common[0].west, -180);
  EXPECT_EQ(common[0].east, -173);
  const auto crossing = CommonBounds({173.9, -5, -172.1, 0}, {170, -4, -173, -1});
  ASSERT_EQ(crossing.size(), 1u);
  EXPECT_EQ(crossing[0].west, 173.9);
  EXPECT_EQ(crossing[0].east, -173);
  const auto before = CommonBounds({173.9, -5, 180, 0}, {-180, -4, -173, -1});
  EXPECT_TRUE(before.empty());
}

}  // namespace
}  // namespace terrace::dem

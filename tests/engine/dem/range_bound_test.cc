#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

void ExpectContained(const ElevationModel& model, const geo::TileKey& key) {
  const auto tile = model.Read(key);
  ASSERT_TRUE(tile) << tile.error().message;
  const HeightRange bound = model.RangeBound(key);
  for (int j = 0; j <= tile->lattice.cells; ++j) {
    for (int i = 0; i <= tile->lattice.cells; ++i) {
      const float height = tile->At(i, j);
      ASSERT_TRUE(height >= bound.min && height <= bound.max)
          << geo::ToString(key) << ": " << height << " at " << i << ", " << j << " outside " << bound.min << " .. "
          << bound.max;
    }
  }
}

TEST(RangeBound, ContainsEveryHeightRead) {
  for (const std::string& name : RealRasters()) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path, {.floor = -50});
    ASSERT_NE(source, nullptr);
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const geo::TileKey& key : SomeTiles(*source, level, 8)) ExpectContained(*source, key);
    }
  }
}

TEST(RangeBound, ContainsTilesAroundTheAvailableOnes) {
  for (const std::string& name : RealRasters()) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path, {.floor = -50});
    ASSERT_NE(source, nullptr);
    for (int level = 1; level <= source->max_level(); level += 2) {
      const geo::TileRange range = source->Available(level).front();
      for (const geo::TileKey& key : {geo::Neighbour({level, range.start_x, range.start_y}, -1, 0),
                                      geo::Neighbour({level, range.end_x, range.end_y}, 1, 0),
                                      geo::Neighbour({level, range.start_x, range.end_y}, 0, 1)}) {
        if (geo::IsValid(key)) ExpectContained(*source, key);
      }
    }
  }
}

TEST(RangeBound, ContainsHeightsOfOverviewsThatOvershoot) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {7, .001, 0, 47, 0, -.001}, .overviews = {2, 4, 8}};
  spec.value = [](int col, int row) { return (col / 7 + row / 5) % 2 * 1000.0; };
  for (const int side : {512, 509}) {
    spec.width = spec.height = side;
    const auto source = OpenOrFail(WriteRaster(dir, spec, std::to_string(side) + ".tif"));
    EXPECT_EQ(source->info().sources[0].overview_factors, (std::vector<int>{2, 4, 8}));
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const geo::TileKey& key : SomeTiles(*source, level, 8)) ExpectContained(*source, key);
    }
  }
}

TEST(RangeBound, IsOnlyTheFloorAwayFromTheSource) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, {.value = [](int col, int) { return col * 10.0; }}), {.floor = -7.5});
  const HeightRange bound = source->RangeBound({6, 3, 50});
  EXPECT_EQ(bound.min, -7.5);
  EXPECT_EQ(bound.max, -7.5);
  const auto tile = source->Read({6, 3, 50});
  ASSERT_TRUE(tile);
  for (const float height : tile->heights) ASSERT_EQ(height, -7.5f);
}

TEST(RangeBound, IsTighterThanTheWholeSource) {
  TERRACE_REQUIRE_DATA(path, "srtm3_S33W071_andes.tif");
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  double relief = 0;
  const auto keys = SomeTiles(*source, 13, 100);
  for (const geo::TileKey& key : keys) relief += source->RangeBound(key).max - source->RangeBound(key).min;
  EXPECT_LT(relief / static_cast<double>(keys.size()), 0.4 * (source->info().heights.max - source->info().heights.min));
}

}  // namespace
}  // namespace terrace::dem

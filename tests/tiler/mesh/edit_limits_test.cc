// Errors of sides and corners that follow from edits.
#include "tiler/mesh/edit_limits.h"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>

#include "engine/dem/tile_edits.h"
#include "tests/engine/dem/edits_fixture.h"

namespace terrace::tiler {
namespace {

// A pole is one point: precision on one meridian must not change its step in some of the tiles.
TEST(EdgeErrors, AreThoseOfTheTileOnAPole) {
  constexpr int kLevel = 7;
  constexpr double kSide = 180.0 / (1 << kLevel), kError_m = 100;
  for (const bool is_north : {false, true}) {
    const dem::TempDir dir;
    dem::RasterSpec spec;
    spec.width = 400, spec.height = 99;
    spec.geo_transform = {9, 0.01, 0, is_north ? 89.99 : -89, 0, -0.01};
    spec.value = [](int column, int) { return 100.0 + column; };
    const std::string raster = dem::WriteRaster(dir, spec, "pole.tif");
    const double nearest = is_north ? 89.8 : -89.8, furthest = is_north ? 89.2 : -89.2;
    dem::DemOptions options;
    options.edits = {dem::WriteEdits(
        dir,
        fmt::format(R"({{"type":"Feature","properties":{{"terrain":{{"op":"precision","width_m":500,)"
                    R"("error_m":0.5}}}},"geometry":{{"type":"LineString","coordinates":[[{0},{1}],[{0},{2}]]}}}})",
                    8 * kSide, nearest, furthest))};
    const auto source = dem::OpenOrFail(raster, options);
    ASSERT_NE(source, nullptr);
    ASSERT_GE(source->max_source_level(), kLevel);
    const std::int64_t column = (1 << kLevel) + 8, row = is_north ? geo::TileRows(kLevel) - 1 : 0;
    for (const std::int64_t dx : {-1, 0}) {
      const geo::TileKey key{kLevel, column + dx, row};
      const proto::EdgeErrors errors =
          EdgeErrorsOf(*source, key, LimitsOf(dem::TileEdits(*source).DemandsOf(key)), kError_m);
      const std::size_t meridian = dx == 0 ? 3 : 1;
      EXPECT_LT(errors.side[meridian], 1);
      // Corners in the order south-west, south-east, north-east, north-west.
      const std::array<std::size_t, 2> polar =
          is_north ? std::array<std::size_t, 2>{2, 3} : std::array<std::size_t, 2>{0, 1};
      for (const std::size_t corner : polar) EXPECT_EQ(errors.corner[corner], kError_m) << dx << " " << corner;
      EXPECT_EQ(errors.side[is_north ? 2 : 0], kError_m);
      const std::size_t other = is_north ? (dx == 0 ? 0 : 1) : (dx == 0 ? 3 : 2);
      EXPECT_LT(errors.corner[other], 1);
    }
  }
}

}  // namespace
}  // namespace terrace::tiler

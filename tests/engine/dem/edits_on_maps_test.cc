// Edits in the pixels of maps (ElevationModel::ReadKnownMercator).
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/edits_fixture.h"

namespace terrace::dem {
namespace {

struct MapPixel {
  double longitude, latitude;
  float height;  // NaN: none
};

// 600 rows of depth 10 over the slope, each with `columns` pixels from `west` on.
std::vector<MapPixel> PixelsFrom(const ElevationModel& model, double west, int columns, HeightDatum datum) {
  const geo::MercatorGrid grid{10};
  const NodeWindow window{static_cast<std::int64_t>((west + 180) / 360 * static_cast<double>(grid.columns())), 88'400,
                          columns, 600};
  const auto heights = model.ReadKnownMercator(10, window, datum);
  EXPECT_TRUE(heights);
  std::vector<MapPixel> pixels;
  for (std::size_t i = 0; heights && i < heights->size(); ++i) {
    const auto at = static_cast<std::int64_t>(i);
    pixels.push_back(
        {grid.Longitude(window.column + at % columns), grid.Latitude(window.row + at / columns), (*heights)[i]});
  }
  return pixels;
}

// The source fills a part of the window. Where neither it nor an edit has a height, maps have none.
TEST_F(TerrainEdits, ShowInMapPixelsAndLeaveTheRestAsItIs) {
  const auto plain = OpenOrFail(slope_);
  const auto edited = Open(Middle(R"({"op":"offset","metres":50})") + "," +
                           Rectangle(R"({"op":"flatten","height":30})", 9.9, 50.1, 10.05, 50.2));
  ASSERT_NE(edited, nullptr);
  const int depth = 10;
  const double pixels = 256.0 * 1024;
  const NodeWindow window{static_cast<std::int64_t>((9.8 + 180) / 360 * pixels), 88'400, 600, 600};
  const auto before = plain->ReadMercator(depth, window), after = edited->ReadMercator(depth, window);
  ASSERT_TRUE(before && after);
  for (const HeightDatum datum : {HeightDatum::kEllipsoid, HeightDatum::kSource}) {
    const auto unedited = plain->ReadKnownMercator(depth, window, datum);
    const auto known = edited->ReadKnownMercator(depth, window, datum);
    ASSERT_TRUE(unedited && known);
    int voids = 0, changed = 0, made = 0;
    for (std::size_t i = 0; i < known->size(); ++i) {
      if (std::isnan((*unedited)[i])) {
        ASSERT_EQ((*before)[i], static_cast<float>(plain->info().floor));
        ++(std::isnan((*known)[i]) ? voids : made);
      } else {
        ASSERT_EQ((*unedited)[i], (*before)[i]);
      }
      if (std::isnan((*known)[i])) continue;
      ASSERT_NEAR((*known)[i], (*after)[i], 1e-4);
      changed += (*after)[i] != (*before)[i] ? 1 : 0;
    }
    EXPECT_GT(voids, 10'000);
    EXPECT_GT(changed, 1000);
    EXPECT_GT(made, 100) << "an edit beside the source";
  }
}

TEST_F(TerrainEdits, ShowOnMapsWhereTheySetTheHeightOfTheFloor) {
  const std::string floor = std::to_string(OpenOrFail(slope_)->info().floor);
  const auto source = Open(Rectangle(R"({"op":"flatten","height":)" + floor + "}", 9.9, 50.1, 10.05, 50.2));
  ASSERT_NE(source, nullptr);
  int inside = 0, outside = 0;
  for (const auto& [x, y, height] : PixelsFrom(*source, 9.8, 200, HeightDatum::kEllipsoid)) {
    if (x > 9.901 && x < 9.999 && y > 50.101 && y < 50.199) {
      ++inside;
      ASSERT_EQ(height, static_cast<float>(source->info().floor)) << x << " " << y;
    } else if (x < 9.899) {
      ++outside;
      ASSERT_TRUE(std::isnan(height)) << x << " " << y;
    }
  }
  EXPECT_GT(inside, 1000);
  EXPECT_GT(outside, 1000);
}

// Contours over an edit where the source has a void at its rim count from the same geoid as those beside it.
TEST_F(TerrainEdits, CountFromTheGeoidOnMapsOverVoidsToo) {
  RasterSpec spec{.width = 400, .height = 400, .geo_transform = {10, 0.001, 0, 50.4, 0, -0.001}, .nodata = -9999};
  spec.value = [](int column, int) { return column < 200 ? -9999.0 : 100.0 + column; };
  DemOptions options;
  options.source.vertical = "egm96";
  options.edits = {
      WriteEdits(dir_, Rectangle(R"({"op":"flatten","height":500,"vertical":"orthometric"})", 10.1, 50.1, 10.3, 50.3))};
  const auto source = OpenOrFail(WriteRaster(dir_, spec, "rim.tif"), options);
  ASSERT_NE(source, nullptr);
  int west = 0, east = 0;
  for (const auto& [x, y, height] : PixelsFrom(*source, 10, 300, HeightDatum::kSource)) {
    if (x < 10.102 || x > 10.298 || y < 50.102 || y > 50.298) continue;
    ++(x < 10.19 ? west : east);
    ASSERT_NEAR(height, 500, 0.02) << x << " " << y;
  }
  EXPECT_GT(west, 1000);
  EXPECT_GT(east, 1000);
}

}  // namespace
}  // namespace terrace::dem

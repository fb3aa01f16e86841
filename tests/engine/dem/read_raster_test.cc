#include "engine/sources/read_raster.h"

#include <algorithm>
#include <cmath>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

TEST(ReadRaster, KeepsTheFilesOrderAndMarksVoids) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {.width = 5,
                                             .height = 3,
                                             .type = "Int16",
                                             .georeferenced = false,
                                             .crs = "",
                                             .nodata = 12,
                                             .value = [](int col, int row) { return col + 10 * row; }});
  double done = 0;
  const auto raster = ReadRaster(path, {.progress = [&](double share) { done = share; }});
  ASSERT_TRUE(raster) << raster.error().message;
  EXPECT_EQ(raster->width, 5);
  EXPECT_EQ(raster->height, 3);
  EXPECT_FALSE(raster->georeferenced);
  EXPECT_EQ(done, 1);
  EXPECT_EQ(raster->heights[4], 4);
  EXPECT_EQ(raster->heights[13], 23);
  EXPECT_TRUE(std::isnan(raster->heights[7]));
}

TEST(ReadRaster, AppliesScaleAndUnit) {
  const TempDir dir;
  const auto raster = ReadRaster(WriteRaster(
      dir, {.type = "UInt16", .unit = "ft", .scale = .5, .offset = 100, .value = [](int, int) { return 20.0; }}));
  ASSERT_TRUE(raster);
  EXPECT_FLOAT_EQ(raster->heights[0], static_cast<float>(110 * 0.3048));
  EXPECT_TRUE(raster->georeferenced);
}

TEST(ReadRaster, ReadsRastersWithoutGeoreference) {
  TERRACE_REQUIRE_DATA(path, "crater.tif");
  const auto raster = ReadRaster(path);
  ASSERT_TRUE(raster);
  EXPECT_EQ(raster->width, 336);
  EXPECT_EQ(*std::ranges::min_element(raster->heights), 1533);
  EXPECT_EQ(*std::ranges::max_element(raster->heights), 2478);
}

TEST(ReadRaster, SaysWhatIsWrongWithHeights) {
  const TempDir dir;
  const auto read = [&](const RasterSpec& spec) { return ReadRaster(WriteRaster(dir, spec)); };
  const auto flat = read({.type = "Int16", .scale = 0, .value = [](int, int) { return 20.0; }});
  ASSERT_FALSE(flat);
  EXPECT_EQ(flat.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(flat.error().message.find("states a scale of 0"), std::string::npos) << flat.error().message;

  const auto centimetres = read({.type = "Int32", .value = [](int x, int) { return 60'000.0 + 10'000 * x; }});
  ASSERT_TRUE(centimetres);
  EXPECT_NE(centimetres->heights_doubted.find("hardly metres"), std::string::npos) << centimetres->heights_doubted;

  const auto too_high = read({.type = "Int32", .value = [](int, int) { return 200'000.0; }});
  ASSERT_FALSE(too_high);
  EXPECT_NE(too_high.error().message.find("heights beyond 99998 m are voids too"), std::string::npos)
      << too_high.error().message;

  const auto furlongs = read({.type = "Int16", .unit = "furlong", .value = [](int, int) { return 3.0; }});
  ASSERT_TRUE(furlongs);
  EXPECT_NE(furlongs->heights_doubted.find("\"furlong\" is not known"), std::string::npos) << furlongs->heights_doubted;
  EXPECT_EQ(read({.type = "Int16", .value = [](int, int) { return 20.0; }})->heights_doubted, "");
}

TEST(ReadRaster, NamesAMissingFile) { EXPECT_EQ(ReadRaster("/nowhere/dem.tif").error().code, ErrorCode::kNotFound); }

}  // namespace
}  // namespace terrace::dem

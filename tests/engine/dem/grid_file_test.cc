#include <cpl_conv.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>
#include <sys/resource.h>

#include <set>
#include <string>
#include <vector>

#include "engine/crs/projector.h"
#include "engine/export/output_grid.h"

namespace terrace::dem {
namespace {

// No other test of this program may use these codes: EpsgWkt keeps what it has found.
TEST(OutputGrid, AFailureOfTheDatabaseIsNoUnknownCodeAndPasses) {
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &limit), 0);
  const rlimit none{0, limit.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Result<std::string> without = EpsgWkt("25831");
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &limit), 0);
  ASSERT_FALSE(without);
  EXPECT_EQ(without.error().code, ErrorCode::kUnavailable) << without.error().message;
  EXPECT_TRUE(EpsgWkt("25831"));
  const Result<std::string> unknown = EpsgWkt("999999");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalidArgument);
}

// GDAL writes such a system beside the file, where a reply has no place for it.
TEST(GridFile, RefusesSystemsThatAGeoTiffCannotState) {
  const GridRequest equal_earth{
      .epsg = 8857, .west = 1e6, .south = 5e6, .east = 1.2e6, .north = 5.2e6, .columns = 2, .rows = 2};
  const auto plan = PlanOutputGrid(equal_earth, 100);
  ASSERT_TRUE(plan) << plan.error().message;
  const std::vector<float> heights(4, 1.0F);
  const auto files = [] {
    const CPLStringList listed(VSIReadDir("/vsimem/"));
    std::set<std::string> names;
    for (int i = 0; i < listed.size(); ++i) names.insert(listed[i]);
    return names;
  };
  const std::set<std::string> before = files();
  const auto file = WriteGeoTiff(*plan, heights);
  ASSERT_FALSE(file);
  EXPECT_EQ(file.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(file.error().message.find("cannot write EPSG:8857"), std::string::npos) << file.error().message;
  EXPECT_EQ(files(), before);
  const auto checked = CheckGeoTiff(*plan);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().message, file.error().message);
  EXPECT_TRUE(
      CheckGeoTiff(*PlanOutputGrid({.west = 7, .south = 46, .east = 8, .north = 47, .columns = 2, .rows = 2}, 100)));
}

// 0.1 and the ends of the boxes are not whole binary numbers.
TEST(GridFile, HasAllNodesOfABoxOfWholeSteps) {
  for (int i = 0; i < 2'000; ++i) {
    const double west = 7'406'718 + i, south = 40'142'372 + 3 * i;  // tenths of a metre
    const int columns = 2 + i % 97, rows = 2 + i % 89;
    const auto plan = PlanOutputGrid({.epsg = 32616,
                                      .west = west / 10,
                                      .south = south / 10,
                                      .east = (west + columns - 1) / 10,
                                      .north = (south + rows - 1) / 10,
                                      .spacing = 0.1},
                                     100'000);
    ASSERT_TRUE(plan) << plan.error().message;
    ASSERT_EQ(plan->columns, columns) << i;
    ASSERT_EQ(plan->rows, rows) << i;
  }
  const auto wider =
      PlanOutputGrid({.west = 10, .south = 49, .east = 10.00099, .north = 49.001, .spacing = 0.0001}, 1000);
  ASSERT_TRUE(wider);
  EXPECT_EQ(wider->columns, 10);
  EXPECT_EQ(wider->rows, 11);
  for (const double spacing : {0.1, 0.3, 0.7, 0.9}) {
    const auto world =
        PlanOutputGrid({.west = -180, .south = -90, .east = 180, .north = 90, .spacing = spacing}, 10'000'000);
    ASSERT_TRUE(world);
    EXPECT_GE(world->south, -90);
    EXPECT_LE(world->east, 180);
  }
}

// Longitudes of EPSG:4813 are counted from Jakarta, those of EPSG:4258 from Greenwich.
TEST(GridFile, BoundsInDegreesNeedLongitudesFromGreenwich) {
  GridRequest request{.epsg = 4813, .west = 0, .south = -7, .east = 1, .north = -6, .columns = 2, .rows = 2};
  const auto jakarta = PlanOutputGrid(request, 100);
  ASSERT_TRUE(jakarta) << jakarta.error().message;
  EXPECT_FALSE(BoundsInCrs(*jakarta, {106, -7, 108, -6}));
  request.epsg = 4258;
  const auto greenwich = PlanOutputGrid(request, 100);
  ASSERT_TRUE(greenwich) << greenwich.error().message;
  ASSERT_TRUE(BoundsInCrs(*greenwich, {106, -7, 108, -6}));
  EXPECT_EQ(BoundsInCrs(*greenwich, {106, -7, 108, -6})->west, 106);
}

// EPSG:3411 is on an ellipsoid of its own, its successor 3413 on that of WGS 84: up to 57 m apart.
TEST(GridFile, OfADeprecatedSystemIsReadAsThatSystem) {
  const auto plan = PlanOutputGrid(
      {.epsg = 3411, .west = 1e6, .south = -1e6, .east = 1.2e6, .north = -0.8e6, .columns = 2, .rows = 2}, 100);
  ASSERT_TRUE(plan) << plan.error().message;
  auto bytes = WriteGeoTiff(*plan, std::vector<float>(4, 1.0F));
  ASSERT_TRUE(bytes) << bytes.error().message;
  constexpr const char* kFile = "/vsimem/deprecated.tif";
  VSIFCloseL(VSIFileFromMemBuffer(kFile, reinterpret_cast<GByte*>(bytes->data()), bytes->size(), FALSE));
  const CPLConfigOptionSetter as_clients("OSR_USE_NON_DEPRECATED", "YES", /*bSetOnlyIfUndefined=*/false);
  const GDALDatasetUniquePtr file(GDALDataset::Open(kFile));
  ASSERT_NE(file, nullptr);
  ASSERT_NE(file->GetSpatialRef(), nullptr);
  EXPECT_EQ(file->GetSpatialRef()->GetSemiMajor(), 6378273);
}

}  // namespace
}  // namespace terrace::dem

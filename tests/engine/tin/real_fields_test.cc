// The mesher on real elevation models: numbers of vertices of other implementations of the paper, and the laws of
// meshes.
#include <gtest/gtest.h>

#include <optional>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"
#include "tests/support/test_data.h"

namespace terrace::tin {
namespace {

using test_support::MissingTestData;
using test_support::ReadTestRaster;
using test_support::TestDataPath;
using test_support::TestRaster;

HeightField FieldOf(std::optional<TestRaster> raster) {
  TERRACE_CHECK(raster.has_value());
  const int width = raster->width;
  return MakeField(width, raster->height, [&](int x, int y) {
    return raster->heights[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  });
}

TEST(RealFields, CraterLakeNeedsAsManyVerticesAsThePaperSays) {
  if (!TestDataPath("crater.tif")) GTEST_SKIP() << MissingTestData("crater.tif");
  const HeightField crater = FieldOf(ReadTestRaster("crater.tif"));
  GreedyTriangulation tin(crater);
  for (const auto& [error, vertices] : {std::pair{20.0, 2033.0}, {5.0, 9806.0}, {1.0, 41688.0}}) {
    EXPECT_TRUE(tin.Run({error}));
    EXPECT_NEAR(static_cast<double>(tin.vertex_count()), vertices, 0.01 * vertices);
    const TinMesh mesh = tin.Mesh();
    EXPECT_TRUE(IsWithin(crater, mesh, error));
    EXPECT_TRUE(CoversExactly(crater, mesh));
    EXPECT_TRUE(IsDelaunay(mesh));
  }
}

TEST(RealFields, CraterLakeIsAsCloseAsThePaperSays) {
  if (!TestDataPath("crater.tif")) GTEST_SKIP() << MissingTestData("crater.tif");
  const HeightField crater = FieldOf(ReadTestRaster("crater.tif"));
  GreedyTriangulation tin(crater);
  for (const auto& [points, rms] : {std::pair{1542u, 7.078}, {5000u, 2.866}, {7711u, 2.0087}, {20000u, 0.8603}}) {
    EXPECT_TRUE(tin.Run({0, points}));
    EXPECT_NEAR(MeasureError(crater, tin.Mesh()).rms, rms, 0.01 * rms);
  }
}

TEST(RealFields, NeighbouringTilesShareTheirBorders) {
  constexpr const char* kName = "srtm3_S33W071_andes.tif";
  if (!TestDataPath(kName)) GTEST_SKIP() << MissingTestData(kName);
  constexpr int kSide = 129, kBlock = 3;
  GreedyOptions options;
  options.borders.fill({.weight = 1.25, .padding_m = 0.2, .sagitta_m = 0.0005});
  options.seeds = {{200, 64}, {50, 32}, {15, 16}};
  options.curvature = {std::vector<double>(kSide, 80.0 * 80), 92.0 * 92, 6.378e6};
  for (const double error : {100.0, 20.0, 5.0}) {
    std::vector<HeightField> fields;
    std::vector<TinMesh> meshes;
    for (int i = 0; i < kBlock * kBlock; ++i) {
      // Row 0 of a field is the first row of the file; "north" below means the side of larger y.
      fields.push_back(
          FieldOf(ReadTestRaster(kName, 300 + i % kBlock * (kSide - 1), 200 + i / kBlock * (kSide - 1), kSide, kSide)));
      GreedyTriangulation tin(fields.back(), options);
      EXPECT_TRUE(tin.Run({error}));
      meshes.push_back(tin.Mesh());
      EXPECT_TRUE(IsWithin(fields.back(), meshes.back(), error));
      EXPECT_TRUE(CoversExactly(fields.back(), meshes.back()));
    }
    const auto border = [&](int i, Side side) {
      return BorderVertices(fields[static_cast<std::size_t>(i)], meshes[static_cast<std::size_t>(i)], side);
    };
    for (int i = 0; i < kBlock * kBlock; ++i) {
      if (i % kBlock + 1 < kBlock) {
        EXPECT_EQ(border(i, Side::kEast), border(i + 1, Side::kWest));
      }
      if (i + kBlock < kBlock * kBlock) {
        EXPECT_EQ(border(i, Side::kNorth), border(i + kBlock, Side::kSouth));
      }
    }
  }
}

TEST(RealFields, VoidsAreNoHeights) {
  constexpr const char* kName = "srtm3_N46E008_swiss_alps.tif";
  if (!TestDataPath(kName)) GTEST_SKIP() << MissingTestData(kName);
  const HeightField alps = FieldOf(ReadTestRaster(kName, 0, 0, 401, 401));
  ASSERT_TRUE(alps.has_voids());
  const TinMesh mesh = [&] {
    GreedyTriangulation tin(alps);
    EXPECT_TRUE(tin.Run({20}));
    return tin.Mesh();
  }();
  EXPECT_TRUE(IsWithin(alps, mesh, 20));
  EXPECT_TRUE(CoversExactly(alps, mesh));
  EXPECT_TRUE(IsDelaunay(mesh));
}

}  // namespace
}  // namespace terrace::tin

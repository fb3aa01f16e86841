#include "tests/bench/uniform_grid.h"

#include <gtest/gtest.h>

#include "engine/tin/mesh_error.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::bench {
namespace {

TEST(UniformGrid, CoversTheFieldWithAnyNumberOfNodes) {
  const tin::HeightField field = tin::NoiseField(23, 17, 1);
  for (const auto& [columns, rows] : {std::pair{2, 2}, {3, 2}, {5, 7}, {23, 17}, {22, 16}}) {
    const tin::TinMesh mesh = UniformGrid(field, columns, rows);
    EXPECT_EQ(mesh.vertices.size(), static_cast<std::size_t>(columns * rows));
    EXPECT_TRUE(tin::CoversExactly(field, mesh));
  }
}

TEST(UniformGrid, OfAllSamplesIsExact) {
  const tin::HeightField field = tin::NoiseField(9, 12, 2);
  EXPECT_EQ(tin::MeasureError(field, UniformGrid(field, 9, 12)).max, 0);
}

TEST(UniformGrid, HasAboutAsManyNodesAsAsked) {
  const tin::HeightField crater = tin::MakeField(336, 459, [](int, int) { return 0.0f; });
  // The grids of the reference table: 9 x 12, 19 x 26, 34 x 46, 61 x 83, 75 x 102, 121 x 165, 191 x 261.
  for (const auto& [points, nodes] : {std::pair{100u, 108u},
                                      {500u, 494u},
                                      {1542u, 1564u},
                                      {5000u, 5063u},
                                      {7711u, 7650u},
                                      {20000u, 19965u},
                                      {50000u, 49851u}}) {
    EXPECT_EQ(UniformGridOf(crater, points).vertices.size(), nodes);
  }
}

}  // namespace
}  // namespace terrace::bench

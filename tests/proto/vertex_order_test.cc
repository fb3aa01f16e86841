#include "proto/mesh/vertex_order.h"

#include <gtest/gtest.h>

namespace terrace::proto {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

TEST(OrderByFirstUse, NumbersVerticesAsTrianglesMeetThem) {
  const VertexOrder order = OrderByFirstUse({{4, 2, 7}, {7, 2, 0}}, 8);
  EXPECT_EQ(order.triangles, (Triangles{{0, 1, 2}, {2, 1, 3}}));
  EXPECT_EQ(order.old_index, (std::vector<std::uint32_t>{4, 2, 7, 0}));
}

TEST(OrderByFirstUse, KeepsWhatIsInOrder) {
  const Triangles triangles = {{0, 1, 2}, {0, 2, 3}, {3, 2, 4}};
  EXPECT_EQ(OrderByFirstUse(triangles, 5).triangles, triangles);
}

TEST(OrderByFirstUse, LeavesOutUnusedVertices) { EXPECT_EQ(OrderByFirstUse({{9, 5, 1}}, 10).old_index.size(), 3u); }

TEST(OrderByFirstUseDeathTest, IndexWithoutVertexIsAMistake) {
  EXPECT_DEATH(OrderByFirstUse({{0, 1, 3}}, 3), "check failed");
}

}  // namespace
}  // namespace terrace::proto

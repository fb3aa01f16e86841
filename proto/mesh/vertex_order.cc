#include "proto/mesh/vertex_order.h"

#include <limits>

#include "engine/core/check.h"

namespace terrace::proto {

VertexOrder OrderByFirstUse(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::size_t vertex_count) {
  constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> new_index(vertex_count, kUnused);
  VertexOrder order;
  order.old_index.reserve(vertex_count);
  order.triangles.reserve(triangles.size());
  for (std::array<std::uint32_t, 3> triangle : triangles) {
    for (std::uint32_t& corner : triangle) {
      TERRACE_CHECK(corner < vertex_count);
      std::uint32_t& number = new_index[corner];
      if (number == kUnused) {
        number = static_cast<std::uint32_t>(order.old_index.size());
        order.old_index.push_back(corner);
      }
      corner = number;
    }
    order.triangles.push_back(triangle);
  }
  return order;
}

}  // namespace terrace::proto

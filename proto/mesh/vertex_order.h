// The vertex numbering that high-water-mark coding needs: vertices in the order in which triangles first use them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace terrace::proto {

struct VertexOrder {
  std::vector<std::uint32_t> old_index;                 // by new number; vertices that no triangle uses are left out
  std::vector<std::array<std::uint32_t, 3>> triangles;  // in new numbers; order and corners as given
};

// Precondition: every index is below `vertex_count`.
VertexOrder OrderByFirstUse(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::size_t vertex_count);

}  // namespace terrace::proto

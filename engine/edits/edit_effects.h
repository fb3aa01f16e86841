// What edits mean outside of this module: how they are drawn, and what they require of meshes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"

namespace terrace::dem {

// An edit, to be drawn.
struct EditOutline {
  std::string op;  // "flatten"
  std::string file;
  std::size_t feature = 0;
  bool is_area = true;                          // closed rings; else lines
  std::vector<std::vector<GeoPosition>> lines;  // closed rings repeat the first position
};

// What edits require of the mesh of a tile, by node without a halo, row by row from the south-western one. A member is
// empty if nothing is required of it. Depends on the nodes' positions and their level alone.
struct MeshDemands {
  std::vector<float> weights;        // the error counts this many times; at least 1
  std::vector<float> caps;           // metres: the error is at most this; infinite: no limit. As many as `weights`
  std::vector<std::uint8_t> forced;  // 1: a vertex of every mesh
  // 1: in an edit with the operation "hole" (not a void). A triangle is left out if each node that it covers, corners
  // included, is in such a hole or forced, and at least one is in the hole.
  std::vector<std::uint8_t> no_triangles;

  bool any() const { return !weights.empty() || !forced.empty() || !no_triangles.empty(); }
};

}  // namespace terrace::dem

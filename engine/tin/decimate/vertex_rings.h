// A triangulation stored as the ring of neighbours around each vertex, for the removal of vertices.
//
// The ring of an inner vertex is closed and counter-clockwise: its triangles are (v, ring[i], ring[i + 1]), cyclic. The
// ring of a border vertex is open: it runs counter-clockwise from one border neighbour to the other. A star is one
// short array, and no list of triangles has to be updated.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class VertexRings {
 public:
  // `mesh` covers a field as TinMesh promises. Closed rings start at their smallest vertex: nothing here depends on the
  // order of the triangles or of their corners.
  explicit VertexRings(const TinMesh& mesh);

  // Valid until the next removal; empty for a vertex that was removed.
  std::span<const std::uint32_t> Of(std::uint32_t vertex) const {
    const Ring& ring = rings_[vertex];
    return {pool_.data() + ring.begin, ring.size};
  }

  // Removes a vertex with a closed ring and fills the polygon that it leaves with the fan of triangles from ring[apex].
  // Precondition: these triangles are counter-clockwise.
  void Remove(std::uint32_t vertex, std::size_t apex);

  // The triangles that are left, each from its smallest vertex, ordered by it: a function of the rings alone.
  std::vector<std::array<std::uint32_t, 3>> Triangles() const;

 private:
  struct Ring {
    std::uint32_t begin = 0;  // in pool_
    std::uint32_t size = 0;
    std::uint32_t capacity = 0;
    bool closed = false;
  };

  // Replaces one entry of a ring by `count` others.
  void Replace(std::uint32_t vertex, std::uint32_t old, std::span<const std::uint32_t> replacement);

  std::vector<Ring> rings_;            // by vertex
  std::vector<std::uint32_t> pool_;    // rings that outgrow their place move to the end
  std::vector<std::uint32_t> spokes_;  // of Remove
};

}  // namespace terrace::tin

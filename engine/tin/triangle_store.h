// The triangles of a triangulation, by slot, as small as they go: insertions jump about in them, and what does not fit
// the processor's second cache makes them wait.
//
// Two forms with the same calls. Narrow, while all vertex ids are below 2^16: 16 bytes a triangle,
//   corners: 3 x 16 bits of the first word; twins: 3 x 21 bits of the second (half-edge 4t + i, all ones: none).
// A triangulation of 2^16 vertices has fewer than 2^17 triangles, whose half-edges take 19 bits. Wide: 24 bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/spare_blocks.h"
#include "engine/tin/star.h"

namespace terrace::tin {

inline constexpr std::uint32_t kNoEdge = 0xFFFFFFFF;

class NarrowTriangles {
 public:
  static constexpr std::size_t kMostVertices = std::size_t{1} << 16;

  struct Triangle {
    std::uint64_t corners = 0;
    std::uint64_t twins = 0;

    VertexId corner(unsigned i) const { return static_cast<std::uint16_t>(corners >> (16 * i)); }
    HalfEdgeId twin(unsigned i) const {
      const std::uint64_t twin = (twins >> (kTwinBits * i)) & kTwinMask;
      return twin == kTwinMask ? kNoEdge : static_cast<HalfEdgeId>(twin);
    }
    void set_twin(unsigned i, HalfEdgeId twin) {
      twins = (twins & ~(kTwinMask << (kTwinBits * i))) | ((twin & kTwinMask) << (kTwinBits * i));
    }
    static Triangle Of(VertexId a, VertexId b, VertexId c, HalfEdgeId ab, HalfEdgeId bc, HalfEdgeId ca) {
      return {a | std::uint64_t{b} << 16 | std::uint64_t{c} << 32,
              (ab & kTwinMask) | (bc & kTwinMask) << kTwinBits | (ca & kTwinMask) << (2 * kTwinBits)};
    }
  };

  LargeArray<Triangle> slots;

 private:
  static constexpr unsigned kTwinBits = 21;
  static constexpr std::uint64_t kTwinMask = (std::uint64_t{1} << kTwinBits) - 1;
};

class WideTriangles {
 public:
  struct Triangle {
    std::array<VertexId, 3> corners;
    std::array<HalfEdgeId, 3> twins;

    VertexId corner(unsigned i) const { return corners[i]; }
    HalfEdgeId twin(unsigned i) const { return twins[i]; }
    void set_twin(unsigned i, HalfEdgeId twin) { twins[i] = twin; }
    static Triangle Of(VertexId a, VertexId b, VertexId c, HalfEdgeId ab, HalfEdgeId bc, HalfEdgeId ca) {
      return {{a, b, c}, {ab, bc, ca}};
    }
  };

  LargeArray<Triangle> slots;
};

}  // namespace terrace::tin

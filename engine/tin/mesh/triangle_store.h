// The triangles of a triangulation, by slot, stored as compactly as possible: insertions access them at random, and
// misses of the second-level cache are slow.
//
// There are two forms with the same functions. Each has its own value for "no half-edge". The narrow form takes 16
// bytes per triangle and serves while all vertex ids are below 2^16:
//   corners: 4 x 16 bits of the first word. The last corner is also stored first, so that the corner across from
//   half-edge i is the i-th.
//   twins: 3 x 21 bits of the second word (half-edge 4t + i).
// A triangulation of 2^16 vertices has fewer than 2^17 triangles, whose half-edges take 19 bits. The wide form takes 24
// bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/tin/mesh/spare_blocks.h"
#include "engine/tin/mesh/star.h"

namespace terrace::tin {

inline constexpr std::uint32_t kNoEdge = 0xFFFFFFFF;

// 0 -> 1 -> 2 -> 0, from tables of two bits each: a comparison would be a mispredicted branch.
constexpr unsigned NextCorner(unsigned i) { return (0b001001U >> (2 * i)) & 3; }
constexpr unsigned PreviousCorner(unsigned i) { return (0b010010U >> (2 * i)) & 3; }

class NarrowTriangles {
 public:
  static constexpr std::size_t kMaxVertices = std::size_t{1} << 16;
  static constexpr unsigned kTwinBits = 21;
  static constexpr HalfEdgeId kNone = (HalfEdgeId{1} << kTwinBits) - 1;

  struct Triangle {
    std::uint64_t corners = 0;
    std::uint64_t twins = 0;

    VertexId corner(unsigned i) const { return opposite(i + 1); }
    VertexId opposite(unsigned i) const { return static_cast<std::uint16_t>(corners >> (16 * i)); }
    HalfEdgeId twin(unsigned i) const { return TwinAt(kTwinBits * i); }
    HalfEdgeId next_twin(unsigned i) const { return TwinAt(Byte(kNextShifts, i)); }
    HalfEdgeId previous_twin(unsigned i) const { return TwinAt(Byte(kPreviousShifts, i)); }
    void set_twin(unsigned i, HalfEdgeId twin) {
      const unsigned shift = kTwinBits * i;
      twins = (twins & ~(std::uint64_t{kNone} << shift)) | std::uint64_t{twin} << shift;
    }
    static Triangle Of(VertexId a, VertexId b, VertexId c, HalfEdgeId ab, HalfEdgeId bc, HalfEdgeId ca) {
      return {c | std::uint64_t{a} << 16 | std::uint64_t{b} << 32 | std::uint64_t{c} << 48,
              ab | std::uint64_t{bc} << kTwinBits | std::uint64_t{ca} << (2 * kTwinBits)};
    }

   private:
    HalfEdgeId TwinAt(unsigned shift) const { return static_cast<HalfEdgeId>(twins >> shift) & kNone; }
    static unsigned Byte(unsigned bytes, unsigned i) { return (bytes >> (8 * i)) & 63; }
  };

  LargeArray<Triangle> slots;

 private:
  static constexpr unsigned kNextShifts = kTwinBits | (2 * kTwinBits) << 8;  // by half-edge, a byte each
  static constexpr unsigned kPreviousShifts = 2 * kTwinBits | kTwinBits << 16;
};

class WideTriangles {
 public:
  static constexpr HalfEdgeId kNone = kNoEdge;

  struct Triangle {
    std::array<VertexId, 3> corners;
    std::array<HalfEdgeId, 3> twins;

    VertexId corner(unsigned i) const { return corners[i]; }
    VertexId opposite(unsigned i) const { return corners[PreviousCorner(i)]; }
    HalfEdgeId twin(unsigned i) const { return twins[i]; }
    HalfEdgeId next_twin(unsigned i) const { return twins[NextCorner(i)]; }
    HalfEdgeId previous_twin(unsigned i) const { return twins[PreviousCorner(i)]; }
    void set_twin(unsigned i, HalfEdgeId twin) { twins[i] = twin; }
    static Triangle Of(VertexId a, VertexId b, VertexId c, HalfEdgeId ab, HalfEdgeId bc, HalfEdgeId ca) {
      return {{a, b, c}, {ab, bc, ca}};
    }
  };

  LargeArray<Triangle> slots;
};

}  // namespace terrace::tin

// The triangles around a vertex that has just been inserted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrace::tin {

using VertexId = std::uint32_t;
using TriangleId = std::uint32_t;
using HalfEdgeId = std::uint32_t;

// A vertex seen from the centre of a star.
struct RingVertex {
  VertexId id = 0;
  std::int32_t dx = 0, dy = 0;  // vertex minus centre
  float height = 0;             // metres
};

// A ring of vertices in parallel arrays, for vectors to load: each has kPadding values more than may be used.
class Ring {
 public:
  static constexpr std::size_t kPadding = 16;

  std::size_t capacity() const { return ids.size() - kPadding; }
  void Grow(std::size_t capacity);

  RingVertex operator[](std::size_t i) const { return {ids[i], dx[i], dy[i], heights[i]}; }
  void Repeat(std::size_t from, std::size_t to) {
    ids[to] = ids[from];
    dx[to] = dx[from];
    dy[to] = dy[from];
    heights[to] = heights[from];
  }
  void Put(std::size_t i, const RingVertex& vertex) {
    ids[i] = vertex.id;
    dx[i] = vertex.dx;
    dy[i] = vertex.dy;
    heights[i] = vertex.height;
  }

  std::vector<VertexId> ids = std::vector<VertexId>(kPadding);
  std::vector<std::int32_t> dx = std::vector<std::int32_t>(kPadding), dy = dx;  // vertex minus centre
  std::vector<float> heights = std::vector<float>(kPadding);                    // metres
};

// The star of a vertex. Triangle i, 0 <= i < count, has the corners ring[i], ring[i + 1] and the centre,
// counter-clockwise and stored in this order. The ring of a closed star has ring[count] equal to ring[0]. A star whose
// centre lies on the border is open: its ring begins and ends on that border.
struct Star {
  VertexId centre = 0;
  std::int32_t x = 0, y = 0;  // of the centre
  float height = 0;           // of the centre, metres
  bool is_closed = true;
  bool has_border = false;  // some triangle may have an edge on the border
  std::size_t count = 0;
  // A bit for each of the first kMaxLeftOut triangles: set for those that scans skip. A ring may thus hold several
  // fans; the triangle between the end of one and the beginning of the next is left out.
  static constexpr std::size_t kMaxLeftOut = 32;
  std::uint32_t left_out = 0;
  // Open stars: the index of the outline's edge that the centre splits. The ring begins after this edge.
  std::size_t split_edge = 0;
  Ring ring;
  std::vector<TriangleId> triangles;  // the first `count` are valid; padded after an insertion, as a ring is
  std::vector<HalfEdgeId> outside;    // by triangle: the twin of the ring's edge
  std::size_t removed_count = 0;      // the first slots in `triangles`: those of removed triangles

  bool IsLeftOut(std::size_t i) const { return i < kMaxLeftOut && (left_out >> i & 1) != 0; }
};

inline void Ring::Grow(std::size_t capacity) {
  ids.resize(capacity + kPadding);
  dx.resize(capacity + kPadding);
  dy.resize(capacity + kPadding);
  heights.resize(capacity + kPadding);
}

}  // namespace terrace::tin

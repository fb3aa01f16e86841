// The topology of a triangulation of a rectangle of samples. Inserting a point returns the star of triangles around it.
//
// Triangle t has the half-edges 4t, 4t+1, 4t+2, counter-clockwise. Half-edge 4t+i runs from corner i to the next
// corner. Its twin is the same edge in the neighbouring triangle, kNone on the border of the rectangle. Slots are never
// freed: an insertion reuses the slots of the triangles that it removes, and appends one or two.
//
// An insertion removes a cavity, the set of triangles that the new point replaces, and joins the cavity's outline to
// the point. The caller's criterion decides which triangles belong to the cavity. With the in-circle test the result is
// Delaunay (Bowyer 1981, Watson 1981; the same triangles as Lawson's flips); with a test of errors it is
// data-dependent. Four points on one circle keep their diagonal. All other decisions are made in integers: the
// triangulation depends on the sequence of insertions and on the criterion alone.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/mesh/triangle_store.h"

namespace terrace::tin {

class Triangulation {
 public:
  static constexpr std::uint32_t kNone = kNoEdge;

  struct Vertex {
    SamplePosition position;
    float height = 0;  // metres
  };
  static Vertex VertexAt(const HeightField& field, int x, int y) {
    return {{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)}, field.VertexHeight(x, y)};
  }

  // The number of vertices to reserve for a mesh of the field: all samples if the field is a tile. A mesh may have
  // more.
  static std::size_t LikelyVertices(const HeightField& field);

  // Two triangles over a rectangle. `corners` become vertices 0 to 3: counter-clockwise, the one with the smallest x
  // and y first.
  explicit Triangulation(const std::array<Vertex, 4>& corners);

  // Two triangles over the field.
  explicit Triangulation(const HeightField& field);

  // Triangles in the order given. Precondition: they cover a rectangle once, counter-clockwise.
  Triangulation(const std::vector<Vertex>& vertices, const std::vector<std::array<std::uint32_t, 3>>& triangles);

  // Inserts a vertex into `triangle`, which must contain the point inside or on an edge. The point must not be a vertex
  // yet. `absorbs(u, v, w, back)` decides whether the triangle (v, u, w) is removed as well. It lies beyond the edge
  // u-v of the outline, and `back` is its half-edge for this edge. `absorbs` must return true if the point lies on the
  // edge, and otherwise only if w lies strictly between u and v as seen from the point (Sees). `keeps(edge)` is called
  // for every edge that stays, with consecutive numbers, also for border edges, for which `absorbs` is not called. The
  // star is valid until the next insertion.
  template <typename Absorbs, typename Keeps>
  const Star& Insert(const Vertex& vertex, TriangleId triangle, Absorbs&& absorbs, Keeps&& keeps);
  template <typename Absorbs>
  const Star& Insert(const Vertex& vertex, TriangleId triangle, Absorbs&& absorbs) {
    return Insert(vertex, triangle, absorbs, [](std::size_t) {});
  }

  const Star& InsertDelaunay(const Vertex& vertex, TriangleId triangle);

  // Insert in steps, for a criterion that tests several edges at once. Outline returns the star without its triangles:
  // the outline of the triangles that `absorbs` accepts. The caller may then replace an edge of it by the other two
  // edges of the triangle beyond: it calls Remove for this triangle and updates the ring, including its last vertex,
  // `outside`, `count` and `has_border`. Fill then makes the triangles.
  template <typename Absorbs, typename Keeps>
  Star& Outline(const Vertex& vertex, TriangleId triangle, Absorbs&& absorbs, Keeps&& keeps);
  void Remove(TriangleId t);
  const Star& Fill();

  // The triangle beyond an edge from u to v of an outline, seen from the outline's inside. Twins are as in `outside`.
  struct Beyond {
    RingVertex w;
    HalfEdgeId uw = 0, wv = 0;
  };
  bool IsBorder(HalfEdgeId outside) const {
    return outside == (is_wide_ ? WideTriangles::kNone : NarrowTriangles::kNone);
  }
  // Precondition: not at the border.
  Beyond BeyondOf(HalfEdgeId outside, SamplePosition point) const {
    return is_wide_ ? BeyondOf(wide_, outside, point) : BeyondOf(narrow_, outside, point);
  }

  // A triangle that contains the point inside, on an edge or as a corner. Found by a walk from `start`. If the walk
  // cycles, which is possible if the triangles are not Delaunay, all triangles are searched.
  TriangleId Locate(SamplePosition point, TriangleId start) const;

  bool IsCorner(SamplePosition point, TriangleId triangle) const;

  // Prefetch what an insertion into the triangle reads first, and what it reads next. The addresses for the second are
  // found in the data of the first.
  void PrefetchAround(TriangleId t) const;
  void PrefetchBeyond(TriangleId t) const;
  // Prefetches what BeyondOf reads first. For a border edge the address is arbitrary, which is harmless. always_inline,
  // because g++ takes a function that only prefetches for one without effect and drops its calls.
  [[gnu::always_inline]] void PrefetchAcross(HalfEdgeId outside) const {
    const std::size_t t = outside / 4;
    const auto address =
        is_wide_ ? reinterpret_cast<std::uintptr_t>(wide_.slots.data()) + t * sizeof(WideTriangles::Triangle)
                 : reinterpret_cast<std::uintptr_t>(narrow_.slots.data()) + t * sizeof(NarrowTriangles::Triangle);
    __builtin_prefetch(reinterpret_cast<const void*>(address));
  }

  TinMesh Mesh() const;

  std::size_t vertex_count() const { return vertices_.size(); }
  std::size_t triangle_count() const { return is_wide_ ? wide_.slots.size() : narrow_.slots.size(); }
  SamplePosition position(VertexId vertex) const { return vertices_[vertex].position; }
  float height(VertexId vertex) const { return vertices_[vertex].height; }
  std::array<VertexId, 3> triangle(TriangleId t) const { return {corner(4 * t), corner(4 * t + 1), corner(4 * t + 2)}; }

  // The vertex relative to `from`, as in a ring.
  RingVertex Seen(VertexId vertex, SamplePosition from) const { return Relative(vertices_.data(), vertex, from); }

  // The corner where a half-edge starts; the twin of a half-edge.
  VertexId corner(HalfEdgeId edge) const {
    return is_wide_ ? wide_.slots[edge / 4].corner(edge % 4) : narrow_.slots[edge / 4].corner(edge % 4);
  }
  HalfEdgeId twin(HalfEdgeId edge) const { return is_wide_ ? TwinIn(wide_, edge) : TwinIn(narrow_, edge); }

  static constexpr HalfEdgeId Next(HalfEdgeId edge) { return (edge & ~HalfEdgeId{3}) + NextCorner(edge % 4); }

 private:
  // An edge of the outline that has not been tested yet. It starts at the end of the edge before it.
  struct PendingEdge {
    HalfEdgeId back;
    RingVertex end;
  };

  static RingVertex Relative(const Vertex* vertices, VertexId id, SamplePosition point) {
    const Vertex& vertex = vertices[id];
    const std::int32_t dx = vertex.position.x - point.x, dy = vertex.position.y - point.y;
    return {id, dx, dy, vertex.height};
  }
  template <typename Triangles, typename Absorbs, typename Keeps>
  void Replace(Triangles& triangles, SamplePosition point, TriangleId triangle, Absorbs&& absorbs, Keeps&& keeps);
  template <typename Triangles>
  Beyond BeyondOf(const Triangles& triangles, HalfEdgeId outside, SamplePosition point) const {
    const auto& beyond = triangles.slots[outside / 4];
    return {Relative(vertices_.data(), beyond.opposite(outside % 4), point), beyond.next_twin(outside % 4),
            beyond.previous_twin(outside % 4)};
  }
  template <typename Triangles>
  void FillCavity(Triangles& triangles);
  void OpenRing(std::size_t edges);
  template <typename Triangles>
  static HalfEdgeId TwinIn(const Triangles& triangles, HalfEdgeId edge) {
    const HalfEdgeId twin = triangles.slots[edge / 4].twin(edge % 4);
    return twin == Triangles::kNone ? kNone : twin;
  }
  template <typename Triangles>
  void PrefetchAround(const Triangles& triangles, TriangleId t) const;
  template <typename Triangles>
  void PrefetchBeyond(const Triangles& triangles, TriangleId t) const;
  template <typename Triangles>
  void Join(Triangles& triangles, const std::vector<std::array<std::uint32_t, 3>>& corners);
  // The first edge of a triangle that has the point on its other side; none if the triangle contains the point.
  std::optional<HalfEdgeId> EdgeTowards(SamplePosition point, TriangleId t) const;
  void Widen();
  void Grow();

  LargeArray<Vertex> vertices_;  // by id
  NarrowTriangles narrow_;       // by slot, until there are too many vertices
  WideTriangles wide_;
  bool is_wide_ = false;

  Star star_;                         // of the last insertion
  std::vector<PendingEdge> pending_;  // stack, from 1 on
};

// Twice the area of (p, a, b). No overflow: two products below 2^30 (IsInsideCircle).
constexpr std::int32_t Cross(const RingVertex& a, const RingVertex& b) { return a.dx * b.dy - a.dy * b.dx; }

// Whether the point p that u, v and w are relative to lies strictly inside the circle through v, u and w, which turn
// counter-clockwise. This is the in-circle determinant in another form: p is inside if the angles at p and at
// w over the chord (u, v) add up to more than half a turn, that is, if the sine of their sum, times four lengths, is
// negative. Two of the four factors do not depend on w, so they are computed while w is loaded. No overflow:
// differences of coordinates are below S = 2^15, so each factor is below 2 S^2 = 2^31 in magnitude, with a margin of
// about 2^17, and the sum of two products is below 2^63.
constexpr bool IsInsideCircle(const RingVertex& v, const RingVertex& u, const RingVertex& w) {
  const std::int32_t ax = u.dx - w.dx, ay = u.dy - w.dy, bx = v.dx - w.dx, by = v.dy - w.dy;
  const std::int32_t sine_at_p = u.dx * v.dy - u.dy * v.dx, cosine_at_p = u.dx * v.dx + u.dy * v.dy;
  const std::int32_t sine_at_w = bx * ay - by * ax, cosine_at_w = ax * bx + ay * by;
  return std::int64_t{sine_at_p} * cosine_at_w + std::int64_t{cosine_at_p} * sine_at_w < 0;
}

// Whether w lies strictly between u and v as seen from the point that they are relative to.
constexpr bool Sees(const RingVertex& u, const RingVertex& v, const RingVertex& w) {
  const bool is_beyond_u = Cross(u, w) > 0, is_before_v = Cross(w, v) > 0;
  return is_beyond_u & is_before_v;
}

template <typename Absorbs, typename Keeps>
const Star& Triangulation::Insert(const Vertex& vertex, TriangleId triangle, Absorbs&& absorbs, Keeps&& keeps) {
  Outline(vertex, triangle, absorbs, keeps);
  return Fill();
}

template <typename Absorbs, typename Keeps>
Star& Triangulation::Outline(const Vertex& vertex, TriangleId triangle, Absorbs&& absorbs, Keeps&& keeps) {
  star_.centre = static_cast<VertexId>(vertices_.size());
  star_.x = vertex.position.x;
  star_.y = vertex.position.y;
  star_.height = vertex.height;
  vertices_.push_back(vertex);
  if (!is_wide_ && vertices_.size() > NarrowTriangles::kMaxVertices) Widen();
  is_wide_ ? Replace(wide_, vertex.position, triangle, absorbs, keeps)
           : Replace(narrow_, vertex.position, triangle, absorbs, keeps);
  return star_;
}

//        w                   w              The outline is walked counter-clockwise with a stack: either the triangle
//       / \                 / \             beyond the edge (u, v) is absorbed and its two other edges are tested
//      /   \               /   \            next, or the edge stays.
//     u-----v     ->      u     v
//        .                   .
//        p                   p
template <typename Triangles, typename Absorbs, typename Keeps>
void Triangulation::Replace(Triangles& triangles, SamplePosition point, TriangleId triangle, Absorbs&& absorbs,
                            Keeps&& keeps) {
  const auto* const slots = triangles.slots.data();
  const Vertex* const vertices = vertices_.data();
  PendingEdge* const stack = pending_.data();
  std::size_t capacity = pending_.size();
  // For an edge on the border the address is arbitrary, which is harmless.
  const auto prefetch = [address = reinterpret_cast<std::uintptr_t>(slots)](HalfEdgeId across) {
    __builtin_prefetch(reinterpret_cast<const void*>(address + sizeof(slots[0]) * (across / 4)));
  };
  const auto first = slots[triangle];
  RingVertex u = Relative(vertices, first.corner(0), point);
  stack[3] = {first.twin(0), Relative(vertices, first.corner(1), point)};
  stack[2] = {first.twin(1), Relative(vertices, first.corner(2), point)};
  stack[1] = {first.twin(2), u};
  const std::int32_t sides[3] = {Cross(u, stack[3].end), Cross(stack[3].end, stack[2].end), Cross(stack[2].end, u)};
  // Inside or on one edge; on two edges it would be a corner.
  TERRACE_CHECK(sides[0] >= 0 && sides[1] >= 0 && sides[2] >= 0);
  TERRACE_CHECK((sides[0] == 0) + (sides[1] == 0) + (sides[2] == 0) <= 1);
  // Triangles are scattered in memory. Prefetches the three neighbours that the walk visits in any case.
  for (std::size_t i = 1; i <= 3; ++i) prefetch(stack[i].back);

  star_.is_closed = true;
  star_.has_border = false;
  TriangleId* removed_slots = star_.triangles.data();
  removed_slots[0] = triangle;
  std::size_t removed = 1, edges = 0;
  for (PendingEdge *bottom = stack, *top = stack + 3; top > bottom;) {
    const HalfEdgeId back = top->back;
    if (back != Triangles::kNone) {
      const auto& beyond = slots[back / 4];
      const RingVertex w = Relative(vertices, beyond.opposite(back % 4), point);
      if (absorbs(u, top->end, w, back)) {
        if (removed + 5 > capacity) {  // edges found and pending are at most the removed triangles plus two
          const auto pending = top - bottom;
          Grow();
          bottom = pending_.data();
          top = bottom + pending;
          removed_slots = star_.triangles.data();
          capacity = pending_.size();
        }
        removed_slots[removed++] = back / 4;
        const HalfEdgeId across_uw = beyond.next_twin(back % 4), across_wv = beyond.previous_twin(back % 4);
        prefetch(across_uw);
        prefetch(across_wv);
        top->back = across_wv;
        ++top;
        top->back = across_uw;
        top->end = {w.id, w.dx, w.dy, w.height};  // a copy of w as a whole would go through memory, absorbed or not
        continue;
      }
    } else {
      star_.has_border = true;
      if (Cross(u, top->end) == 0) {
        star_.is_closed = false;
        star_.split_edge = edges;
      }
    }
    keeps(edges);
    star_.ring.Put(edges, u);
    star_.outside[edges++] = back;
    u = top->end;
    --top;
  }
  star_.removed_count = removed;
  if (star_.is_closed) {
    star_.ring.Repeat(0, edges);
  } else {
    OpenRing(edges--);
  }
  star_.count = edges;
}

inline const Star& Triangulation::Fill() {
  is_wide_ ? FillCavity(wide_) : FillCavity(narrow_);
  return star_;
}

//      u3---u2                u3---u2
//     /       \              / \ t2/ \            t_i = (u_i, u_i+1, p), its half-edge 0 on the outline. Closed: t_i+1
//    u4        u1    ->     u4--p---u1            follows t_i all around. Open: the edge u_k u_0 holds p and has no
//     \       /              \ / \ t0/            triangle.
//      u5---u0                u5---u0
template <typename Triangles>
void Triangulation::FillCavity(Triangles& triangles) {
  const std::size_t edges = star_.count;
  TriangleId* const made = star_.triangles.data();  // the slots of removed triangles come first and are set already
  const auto appended = static_cast<TriangleId>(triangles.slots.size());
  TERRACE_CHECK(appended < kNone / 4 - 2);
  for (std::size_t i = star_.removed_count; i < edges; ++i) {
    made[i] = appended + static_cast<TriangleId>(i - star_.removed_count);
  }
  triangles.slots.GrowBy(edges - star_.removed_count);

  made[edges] = made[0];  // the triangle after the last one

  auto* const slots = triangles.slots.data();
  const VertexId* const ids = star_.ring.ids.data();
  HalfEdgeId* const outsides = star_.outside.data();
  const VertexId centre = star_.centre;
  VertexId u = ids[0];
  TriangleId before = made[edges - 1], t = made[0];
  for (std::size_t i = 0; i < edges; ++i) {
    const TriangleId after = made[i + 1];
    const VertexId v = ids[i + 1];
    const HalfEdgeId outside = outsides[i];
    slots[t] = Triangles::Triangle::Of(u, v, centre, outside, 4 * after + 2, 4 * before + 1);
    if (outside != Triangles::kNone) {
      slots[outside / 4].set_twin(outside % 4, 4 * t);
    } else {
      outsides[i] = kNone;
    }
    before = t;
    t = after;
    u = v;
  }
  if (star_.is_closed) return;
  slots[made[edges - 1]].set_twin(1, Triangles::kNone);
  slots[made[0]].set_twin(2, Triangles::kNone);
}

}  // namespace terrace::tin

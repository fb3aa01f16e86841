#include "engine/tin/mesh/triangulation.h"

#include <utility>

namespace terrace::tin {

Triangulation::Triangulation(const std::array<Vertex, 4>& corners) {
  //  3-----2
  //  | 1 / |
  //  | /  0|
  //  0-----1
  using Triangle = NarrowTriangles::Triangle;
  vertices_.Append(corners);
  narrow_.slots.push_back(Triangle::Of(0, 1, 2, NarrowTriangles::kNone, NarrowTriangles::kNone, 6));
  narrow_.slots.push_back(Triangle::Of(2, 3, 0, NarrowTriangles::kNone, NarrowTriangles::kNone, 2));
  Grow();
}

Triangulation::Triangulation(const HeightField& field)
    : Triangulation({VertexAt(field, 0, 0), VertexAt(field, field.width() - 1, 0),
                     VertexAt(field, field.width() - 1, field.height() - 1), VertexAt(field, 0, field.height() - 1)}) {
  vertices_.reserve(LikelyVertices(field));
  narrow_.slots.reserve(2 * LikelyVertices(field));
}

std::size_t Triangulation::LikelyVertices(const HeightField& field) {
  const std::size_t samples = static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height());
  return std::min(samples, NarrowTriangles::kMaxVertices);
}

Triangulation::Triangulation(const std::vector<Vertex>& vertices,
                             const std::vector<std::array<std::uint32_t, 3>>& triangles)
    : is_wide_(vertices.size() > NarrowTriangles::kMaxVertices) {
  vertices_.Append(vertices);
  is_wide_ ? Join(wide_, triangles) : Join(narrow_, triangles);
  Grow();
}

// Half-edges to a larger id, sorted by the corner that they start from: the twin of (b, a) is among the few that start
// from a.
template <typename Triangles>
void Triangulation::Join(Triangles& triangles, const std::vector<std::array<std::uint32_t, 3>>& corners) {
  const auto for_each_edge = [&](auto&& visit) {
    for (TriangleId t = 0; t < corners.size(); ++t) {
      const auto [a, b, c] = corners[t];
      visit(a, b, 4 * t);
      visit(b, c, 4 * t + 1);
      visit(c, a, 4 * t + 2);
    }
  };
  triangles.slots.reserve(corners.size());
  for (const auto& [a, b, c] : corners) {
    triangles.slots.push_back(Triangles::Triangle::Of(a, b, c, Triangles::kNone, Triangles::kNone, Triangles::kNone));
  }
  // Without branches: the direction of an edge would be mispredicted.
  std::vector<std::uint32_t> ends(vertices_.size() + 1, 0);
  for_each_edge([&](VertexId a, VertexId b, HalfEdgeId) { ends[a + std::size_t{1}] += a < b ? 1 : 0; });
  for (std::size_t vertex = 0; vertex < vertices_.size(); ++vertex) ends[vertex + 1] += ends[vertex];
  struct Rising {
    VertexId end;
    HalfEdgeId edge;
  };
  const std::uint32_t unused = ends.back();
  std::vector<Rising> rising(unused + std::size_t{1});
  // The begin of each vertex's half-edges advances to their end.
  for_each_edge([&](VertexId a, VertexId b, HalfEdgeId edge) {
    rising[a < b ? ends[a] : unused] = {b, edge};
    ends[a] += a < b ? 1 : 0;
  });
  for_each_edge([&](VertexId b, VertexId a, HalfEdgeId edge) {
    if (b < a) return;
    for (std::uint32_t k = a == 0 ? 0 : ends[a - 1]; k < ends[a]; ++k) {
      if (rising[k].end != b) continue;
      const HalfEdgeId back = rising[k].edge;
      triangles.slots[edge / 4].set_twin(edge % 4, back);
      triangles.slots[back / 4].set_twin(back % 4, edge);
      return;
    }
  });
}

// The in-circle test is true if the point lies on the edge, which is inside the circle, and false if w is not visible:
// an empty circle lies beyond the edge only between the edge's ends.
const Star& Triangulation::InsertDelaunay(const Vertex& vertex, TriangleId triangle) {
  return Insert(vertex, triangle, [](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId) {
    return IsInsideCircle(v, u, w);
  });
}

void Triangulation::Grow() {
  const std::size_t capacity = 2 * pending_.size() + 64;
  pending_.resize(capacity);
  star_.ring.Grow(capacity);
  star_.triangles.resize(capacity + Ring::kPadding);
  star_.outside.resize(capacity);
}

void Triangulation::Remove(TriangleId t) {
  if (star_.removed_count + 5 > pending_.size()) Grow();  // capacity as for the walk
  star_.triangles[star_.removed_count++] = t;
}

void Triangulation::Widen() {
  wide_.slots.reserve(2 * narrow_.slots.size());
  for (TriangleId t = 0; t < narrow_.slots.size(); ++t) {
    wide_.slots.push_back(
        {{corner(4 * t), corner(4 * t + 1), corner(4 * t + 2)}, {twin(4 * t), twin(4 * t + 1), twin(4 * t + 2)}});
  }
  narrow_.slots.Release();
  is_wide_ = true;
}

// always_inline, because g++ takes a function that only prefetches for one without effect and drops its calls.
template <typename Triangles>
[[gnu::always_inline]] inline void Triangulation::PrefetchAround(const Triangles& triangles, TriangleId t) const {
  const auto* const slots = triangles.slots.data();
  const auto triangle = slots[t];
#pragma GCC unroll 3
  for (unsigned i = 0; i < 3; ++i) {
    __builtin_prefetch(&vertices_[triangle.corner(i)]);
    if (const HalfEdgeId back = triangle.twin(i); back != Triangles::kNone) __builtin_prefetch(&slots[back / 4]);
  }
}

void Triangulation::PrefetchAround(TriangleId t) const {
  is_wide_ ? PrefetchAround(wide_, t) : PrefetchAround(narrow_, t);
}

template <typename Triangles>
[[gnu::always_inline]] inline void Triangulation::PrefetchBeyond(const Triangles& triangles, TriangleId t) const {
  const auto* const slots = triangles.slots.data();
  const auto triangle = slots[t];
#pragma GCC unroll 3
  for (unsigned i = 0; i < 3; ++i) {
    const HalfEdgeId back = triangle.twin(i);
    if (back == Triangles::kNone) continue;
    __builtin_prefetch(&vertices_[slots[back / 4].opposite(back % 4)]);
  }
}

void Triangulation::PrefetchBeyond(TriangleId t) const {
  is_wide_ ? PrefetchBeyond(wide_, t) : PrefetchBeyond(narrow_, t);
}

// Makes the ring begin after the edge that contains the centre.
void Triangulation::OpenRing(std::size_t edges) {
  const auto first = static_cast<std::ptrdiff_t>(star_.split_edge + 1), count = static_cast<std::ptrdiff_t>(edges);
  const auto turn = [=](auto& values) { std::rotate(values.begin(), values.begin() + first, values.begin() + count); };
  turn(star_.ring.ids);
  turn(star_.ring.dx);
  turn(star_.ring.dy);
  turn(star_.ring.heights);
  turn(star_.outside);
}

TinMesh Triangulation::Mesh() const {
  TinMesh mesh;
  mesh.vertices.resize(vertices_.size());
  std::transform(vertices_.begin(), vertices_.end(), mesh.vertices.begin(), [](const Vertex& v) { return v.position; });
  mesh.triangles.resize(triangle_count());
  const auto copy = [&](const auto& slots) {
    std::transform(slots.begin(), slots.end(), mesh.triangles.begin(), [](const auto& t) {
      return std::array<VertexId, 3>{t.corner(0), t.corner(1), t.corner(2)};
    });
  };
  is_wide_ ? copy(wide_.slots) : copy(narrow_.slots);
  return mesh;
}

TriangleId Triangulation::Locate(SamplePosition point, TriangleId start) const {
  // In a Delaunay triangulation this walk visits no triangle twice: each step lowers the power of the point with
  // respect to the triangle's circumcircle, or stays on one circle, whose triangles form a tree.
  TriangleId t = start;
  for (std::size_t steps = 0; steps < triangle_count(); ++steps) {
    const std::optional<HalfEdgeId> towards = EdgeTowards(point, t);
    if (!towards) return t;
    TERRACE_CHECK(twin(*towards) != kNone);  // the point lies outside the rectangle
    t = twin(*towards) / 4;
  }
  for (t = 0; t < triangle_count(); ++t) {
    if (!EdgeTowards(point, t)) return t;
  }
  TERRACE_CHECK(t < triangle_count());
  return t;
}

std::optional<HalfEdgeId> Triangulation::EdgeTowards(SamplePosition point, TriangleId t) const {
  for (HalfEdgeId edge = 4 * t; edge < 4 * t + 3; ++edge) {
    if (Orientation(position(corner(edge)), position(corner(Next(edge))), point) < 0) return edge;
  }
  return std::nullopt;
}

bool Triangulation::IsCorner(SamplePosition point, TriangleId t) const {
  for (const VertexId vertex : triangle(t)) {
    if (position(vertex) == point) return true;
  }
  return false;
}

}  // namespace terrace::tin

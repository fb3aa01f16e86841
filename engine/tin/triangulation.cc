#include "engine/tin/triangulation.h"

#include "engine/core/check.h"
#include "engine/tin/predicates.h"

// Invariant of an insertion: every triangle around the new vertex p is stored as (u, v, p), so that its half-edge 0 is
// the edge opposite p. Splits establish it, flips keep it, and only opposite edges ever become suspect.
namespace terrace::tin {

Triangulation::Triangulation(int width, int height) {
  const auto east = static_cast<std::uint16_t>(width - 1), north = static_cast<std::uint16_t>(height - 1);
  positions_ = {{0, 0}, {east, 0}, {east, north}, {0, north}};
  //  3-----2
  //  | 1 / |
  //  | /  0|
  //  0-----1
  AddTriangle();
  AddTriangle();
  SetTriangle(0, 0, 1, 2);
  SetTriangle(1, 2, 3, 0);
  Link(2, 5);
}

std::span<const TriangleId> Triangulation::Insert(SamplePosition point, TriangleId triangle) {
  const auto p = static_cast<VertexId>(positions_.size());
  positions_.push_back(point);
  star_.clear();

  HalfEdgeId on_edge = kNone;
  for (HalfEdgeId edge = 3 * triangle; edge < 3 * triangle + 3; ++edge) {
    const std::int64_t side = Orientation(positions_[corners_[edge]], positions_[corners_[Next(edge)]], point);
    TERRACE_CHECK(side >= 0);
    if (side > 0) continue;
    TERRACE_CHECK(on_edge == kNone);  // on two edges: a corner
    on_edge = edge;
  }
  if (on_edge == kNone) {
    SplitTriangle(triangle, p);
  } else if (twins_[on_edge] == kNone) {
    SplitBorderEdge(on_edge, p);
  } else {
    SplitInteriorEdge(on_edge, p);
  }
  Legalize();
  return star_;
}

TriangleId Triangulation::Locate(SamplePosition point, TriangleId start) const {
  // In a Delaunay triangulation this walk visits no triangle twice: each step lowers the power of the point with
  // respect to the triangle's circumcircle, or stays on one circle, whose triangles form a tree.
  TriangleId t = start;
  for (unsigned i = 0; i < 3;) {
    const HalfEdgeId edge = 3 * t + i;
    if (Orientation(positions_[corners_[edge]], positions_[corners_[Next(edge)]], point) >= 0) {
      ++i;
      continue;
    }
    TERRACE_CHECK(twins_[edge] != kNone);  // the point lies outside the rectangle
    t = twins_[edge] / 3;
    i = 0;
  }
  return t;
}

bool Triangulation::IsCorner(SamplePosition point, TriangleId triangle) const {
  for (const VertexId vertex : this->triangle(triangle)) {
    if (positions_[vertex] == point) return true;
  }
  return false;
}

TriangleId Triangulation::AddTriangle() {
  TERRACE_CHECK(corners_.size() < kNone - 3);
  corners_.resize(corners_.size() + 3, kNone);
  twins_.resize(twins_.size() + 3, kNone);
  return static_cast<TriangleId>(corners_.size() / 3 - 1);
}

void Triangulation::SetTriangle(TriangleId t, VertexId a, VertexId b, VertexId c) {
  corners_[3 * t] = a;
  corners_[3 * t + 1] = b;
  corners_[3 * t + 2] = c;
}

void Triangulation::Link(HalfEdgeId edge, HalfEdgeId twin) {
  if (edge != kNone) twins_[edge] = twin;
  if (twin != kNone) twins_[twin] = edge;
}

//        c                   c
//       / \                 /|\              t0 = (a, b, p), in the slot of t
//      /   \               / | \             t1 = (b, c, p)
//     /  t  \     ->      /t2|t1\            t2 = (c, a, p)
//    /   p   \           /  .p.  \           .
//   /         \         /.'  t0 '.\          .
//  a-----------b       a-----------b
void Triangulation::SplitTriangle(TriangleId t, VertexId p) {
  const auto [a, b, c] = triangle(t);
  const HalfEdgeId outer_bc = twins_[3 * t + 1], outer_ca = twins_[3 * t + 2];
  const TriangleId t1 = AddTriangle(), t2 = AddTriangle();
  SetTriangle(t, a, b, p);
  SetTriangle(t1, b, c, p);
  SetTriangle(t2, c, a, p);
  Link(3 * t1, outer_bc);
  Link(3 * t2, outer_ca);
  Link(3 * t + 1, 3 * t1 + 2);
  Link(3 * t1 + 1, 3 * t2 + 2);
  Link(3 * t2 + 1, 3 * t + 2);
  star_.assign({t, t1, t2});
}

//        c                   c
//       / \                 /|\              t0 = (c, a, p), in the slot of t
//      / t \               / | \             t1 = (b, c, p)
//     /     \             /t0|t1\            s0 = (a, d, p), in the slot of s
//    a---p---b    ->     a---p---b           s1 = (d, b, p)
//     \     /             \s0|s1/            .
//      \ s /               \ | /             `edge` runs from a to b
//       \ /                 \|/
//        d                   d
void Triangulation::SplitInteriorEdge(HalfEdgeId edge, VertexId p) {
  const HalfEdgeId back = twins_[edge];
  const TriangleId t = edge / 3, s = back / 3;
  const VertexId a = corners_[edge], b = corners_[back], c = corners_[Previous(edge)], d = corners_[Previous(back)];
  const HalfEdgeId outer_bc = twins_[Next(edge)], outer_ca = twins_[Previous(edge)];
  const HalfEdgeId outer_ad = twins_[Next(back)], outer_db = twins_[Previous(back)];
  const TriangleId t1 = AddTriangle(), s1 = AddTriangle();
  SetTriangle(t, c, a, p);
  SetTriangle(t1, b, c, p);
  SetTriangle(s, a, d, p);
  SetTriangle(s1, d, b, p);
  Link(3 * t, outer_ca);
  Link(3 * t1, outer_bc);
  Link(3 * s, outer_ad);
  Link(3 * s1, outer_db);
  Link(3 * t + 1, 3 * s + 2);
  Link(3 * s + 1, 3 * s1 + 2);
  Link(3 * s1 + 1, 3 * t1 + 2);
  Link(3 * t1 + 1, 3 * t + 2);
  star_.assign({t, t1, s, s1});
}

//        c                   c
//       / \                 /|\              t0 = (c, a, p), in the slot of t
//      / t \               / | \             t1 = (b, c, p)
//     /     \             /t0|t1\            .
//    a---p---b    ->     a---p---b           `edge` runs from a to b along the border
void Triangulation::SplitBorderEdge(HalfEdgeId edge, VertexId p) {
  const TriangleId t = edge / 3;
  const VertexId a = corners_[edge], b = corners_[Next(edge)], c = corners_[Previous(edge)];
  const HalfEdgeId outer_bc = twins_[Next(edge)], outer_ca = twins_[Previous(edge)];
  const TriangleId t1 = AddTriangle();
  SetTriangle(t, c, a, p);
  SetTriangle(t1, b, c, p);
  Link(3 * t, outer_ca);
  Link(3 * t1, outer_bc);
  Link(3 * t1 + 1, 3 * t + 2);
  twins_[3 * t + 1] = kNone;
  twins_[3 * t1 + 2] = kNone;
  star_.assign({t, t1});
}

//        p                   p
//       / \                 /|\              t = (u, v, p)  ->  (u, w, p)
//      / t \               / | \             s = (v, u, w)  ->  (w, v, p)
//     /     \             /  |  \            .
//    u-------v    ->     u t | s v           Half-edge 0 of both is again opposite p.
//     \     /             \  |  /
//      \ s /               \ | /
//       \ /                 \|/
//        w                   w
void Triangulation::FlipOppositeEdge(TriangleId t) {
  const HalfEdgeId back = twins_[3 * t];
  const TriangleId s = back / 3;
  const VertexId u = corners_[3 * t], v = corners_[3 * t + 1], p = corners_[3 * t + 2], w = corners_[Previous(back)];
  const HalfEdgeId outer_uw = twins_[Next(back)], outer_wv = twins_[Previous(back)], spoke_v = twins_[3 * t + 1];
  SetTriangle(t, u, w, p);
  SetTriangle(s, w, v, p);
  Link(3 * t, outer_uw);
  Link(3 * s, outer_wv);
  Link(3 * s + 1, spoke_v);
  Link(3 * t + 1, 3 * s + 2);
  star_.push_back(s);
}

// A flip that the in-circle test asks for is always possible: w lies strictly inside the circle through u, v, p and
// beyond uv, so it is seen from p between u and v, and the quadrilateral is strictly convex.
void Triangulation::Legalize() {
  suspects_.assign(star_.rbegin(), star_.rend());
  while (!suspects_.empty()) {
    const TriangleId t = suspects_.back();
    const HalfEdgeId back = twins_[3 * t];
    if (back == kNone) {
      suspects_.pop_back();
      continue;
    }
    const auto [u, v, p] = triangle(t);
    const VertexId w = corners_[Previous(back)];
    if (InCircle(positions_[u], positions_[v], positions_[p], positions_[w]) <= 0) {
      suspects_.pop_back();
      continue;
    }
    FlipOppositeEdge(t);
    suspects_.push_back(back / 3);
  }
}

}  // namespace terrace::tin

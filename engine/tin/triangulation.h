// The topology of a Delaunay triangulation of a rectangle of samples: insert a point, get the triangles that changed.
//
// Half-edges in compact parallel arrays: triangle t owns the half-edges 3t, 3t+1, 3t+2, counter-clockwise; half-edge e
// runs from corner(e) to the corner of the next half-edge of its triangle, and twin(e) is the same edge seen from the
// neighbour, kNone on the border of the rectangle. Triangles are never freed: slots are reused by the triangles that
// replace them, and new ones are appended.
//
// Guibas and Stolfi's incremental algorithm ("Primitives for the Manipulation of General Subdivisions", 1985) with
// Lawson flips. Everything is decided in integers, and four points on one circle keep the diagonal they have: the
// triangulation is a function of the sequence of insertions alone.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/tin/tin_mesh.h"

namespace terrace::tin {

using VertexId = std::uint32_t;
using TriangleId = std::uint32_t;
using HalfEdgeId = std::uint32_t;

class Triangulation {
 public:
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;

  // Two triangles over [0, width-1] x [0, height-1]. Vertices 0 to 3 are the corners, counter-clockwise from (0, 0).
  Triangulation(int width, int height);

  // Inserts a vertex into `triangle`, which must contain the point in its inside or on an edge; it must not be a vertex
  // yet. Returns the triangles around the new vertex: all that are new or changed, in a deterministic order, valid
  // until the next insertion.
  std::span<const TriangleId> Insert(SamplePosition point, TriangleId triangle);

  // A triangle that contains the point, inside, on an edge or as a corner, found by a walk from `start`.
  TriangleId Locate(SamplePosition point, TriangleId start) const;

  bool IsCorner(SamplePosition point, TriangleId triangle) const;

  std::size_t vertex_count() const { return positions_.size(); }
  std::size_t triangle_count() const { return corners_.size() / 3; }
  SamplePosition position(VertexId vertex) const { return positions_[vertex]; }
  VertexId corner(HalfEdgeId edge) const { return corners_[edge]; }
  HalfEdgeId twin(HalfEdgeId edge) const { return twins_[edge]; }
  std::array<VertexId, 3> triangle(TriangleId t) const {
    return {corners_[3 * t], corners_[3 * t + 1], corners_[3 * t + 2]};
  }
  const std::vector<SamplePosition>& positions() const { return positions_; }

  static constexpr HalfEdgeId Next(HalfEdgeId edge) { return edge % 3 == 2 ? edge - 2 : edge + 1; }
  static constexpr HalfEdgeId Previous(HalfEdgeId edge) { return edge % 3 == 0 ? edge + 2 : edge - 1; }

 private:
  TriangleId AddTriangle();
  void SetTriangle(TriangleId t, VertexId a, VertexId b, VertexId c);
  void Link(HalfEdgeId edge, HalfEdgeId twin);  // both ways; either may be kNone

  void SplitTriangle(TriangleId t, VertexId p);
  void SplitInteriorEdge(HalfEdgeId edge, VertexId p);
  void SplitBorderEdge(HalfEdgeId edge, VertexId p);
  void FlipOppositeEdge(TriangleId t);
  void Legalize();

  std::vector<SamplePosition> positions_;  // by vertex
  std::vector<VertexId> corners_;          // by half-edge: where it starts
  std::vector<HalfEdgeId> twins_;          // by half-edge
  std::vector<TriangleId> star_;           // of the last insertion
  std::vector<TriangleId> suspects_;       // stack of Legalize
};

}  // namespace terrace::tin

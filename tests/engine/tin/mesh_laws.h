// Laws of all meshes of the mesher, checked by slow plain code.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// Corners first, no vertex twice, counter-clockwise triangles whose areas add up to the field's and whose edges are
// each used once in each direction or lie on the border.
testing::AssertionResult CoversExactly(const HeightField& field, const TinMesh& mesh);

// Of a counter-clockwise abc: positive when d lies strictly inside the circle through a, b and c, zero on it, negative
// outside. Width, with S of predicates.h: relative to d, each squared length is below 2 S^2. Each 2 x 2 determinant is
// twice the area of a triangle inside a square of side S - 1, hence below S^2. So each of the three terms is below 2
// S^4 and every partial sum below 6 S^4 = 6 * 2^60 < 2^63.
constexpr std::int64_t InCircle(SamplePosition a, SamplePosition b, SamplePosition c, SamplePosition d) {
  const std::int64_t ax = a.x - d.x, ay = a.y - d.y;
  const std::int64_t bx = b.x - d.x, by = b.y - d.y;
  const std::int64_t cx = c.x - d.x, cy = c.y - d.y;
  return (ax * ax + ay * ay) * (bx * cy - by * cx) + (bx * bx + by * by) * (cx * ay - cy * ax) +
         (cx * cx + cy * cy) * (ax * by - ay * bx);
}

// No vertex across an edge is strictly inside the circumcircle of the triangle, so the mesh is locally, and therefore
// globally, Delaunay.
testing::AssertionResult IsDelaunay(const TinMesh& mesh);

// Every valid sample is within `bound` of the mesh, as measured by MeasureError, and every valid sample was measured.
testing::AssertionResult IsWithin(const HeightField& field, const TinMesh& mesh, double bound);

// The positions of the vertices on one side along that side, ascending.
std::vector<int> BorderVertices(const HeightField& field, const TinMesh& mesh, Side side);

// The same vertices in the same order, and the same triangles in the same order.
testing::AssertionResult AreEqual(const TinMesh& a, const TinMesh& b);

// Runs the mesher, which must reach the goal.
TinMesh MeshAt(const HeightField& field, const GreedyGoal& goal, const GreedyOptions& options = {});

}  // namespace terrace::tin

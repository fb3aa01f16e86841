// Laws of all meshes of the mesher, checked by slow plain code.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

// Corners first, no vertex twice, counter-clockwise triangles whose areas add up to the field's and whose edges are
// each used once in each direction or lie on the border.
testing::AssertionResult CoversExactly(const HeightField& field, const TinMesh& mesh);

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

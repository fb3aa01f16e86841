// Adds vertices inside tiles that have few besides those of their edges.
#pragma once

#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"

namespace terrace::tiler {

// Normals on an edge come from the edge's own samples, which the neighbour shares. At the rim of the data they ignore
// the cliff that the tile's few triangles span, and shading is wrong. If that holds for half of the vertices, this
// inserts as many vertices on a grid of lattice nodes; their normals follow the triangles
// (docs/decisions/0003-normals-inside-follow-the-mesh.md). Edges do not change.
tin::TinMesh WithInnerVertices(const proto::LatticeView& lattice, tin::TinMesh mesh);

}  // namespace terrace::tiler

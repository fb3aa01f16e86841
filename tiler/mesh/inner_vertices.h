// Vertices inside of tiles that are hardly more than their edges.
#pragma once

#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"

namespace terrace::tiler {

// The normals of an edge are those of its own samples, which the neighbour shares. Beside the end of the data they know
// nothing of the cliff that the tile's few triangles span, and light falls on the wrong sides. Where that is so for
// half of the vertices, as many are inserted on a grid of lattice nodes: their normals follow the triangles
// (docs/decisions/0003-normals-inside-follow-the-mesh.md). Edges stay as they are.
tin::TinMesh WithInnerVertices(const proto::LatticeView& lattice, tin::TinMesh mesh);

}  // namespace terrace::tiler

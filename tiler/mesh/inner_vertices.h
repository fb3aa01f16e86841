// Adds vertices inside tiles that have few besides those of their edges.
#pragma once

#include "engine/tin/mesh/tin_mesh.h"
#include "proto/tile_samples.h"

namespace terrace::tiler {

// Normals on an edge come from the edge's own samples, which the neighbour shares. At the rim of the data they do not
// show the cliff that the tile's few triangles span, and shading is wrong. If at least half of the vertices lie on
// edges and at least half of the normals do not fit the triangles, this function inserts about as many vertices as the
// edges have, on a grid of lattice nodes inside. Their normals follow the triangles
// (docs/decisions/0003-normals-inside-follow-the-mesh.md). Edges do not change.
tin::TinMesh WithInnerVertices(const proto::TileSamples& samples, tin::TinMesh mesh);

}  // namespace terrace::tiler

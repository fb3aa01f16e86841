// Normals of a tile's vertices.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

// Unit normals in ECEF, one per vertex of `mesh`, whose quantized vertices lie at `positions` (ECEF).
//
// On the edges the gradient of the heights, by central differences over one lattice step on each side, each within 13
// degrees of the limited difference (van Leer, "Towards the ultimate conservative difference scheme. II", 1974): a
// function of the global node and so equal in every tile that shares it; on a pole the ellipsoid's normal. Inside the
// plain gradient, turned to within 13 degrees of the mesh's own area-weighted normal: where the mesh drops relief that
// the lattice has, and at cliffs, light must still fit the triangles that it falls on.
std::vector<geo::Vec3> VertexNormals(const LatticeView& lattice, const tin::TinMesh& mesh,
                                     const std::vector<geo::Vec3>& positions);

// How many of these normals are more than 13.5 degrees from the area-weighted normals of the triangles around their
// vertices.
std::size_t CountMisfits(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions,
                         const std::vector<geo::Vec3>& normals);

// VertexNormals oct-encoded, for the mesh that `tile` was quantized from.
std::vector<std::array<std::uint8_t, 2>> TileNormals(const LatticeView& lattice, const tin::TinMesh& mesh,
                                                     const QuantizedTile& tile);

}  // namespace terrace::proto

// Normals of a tile's vertices.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

// Unit normals in ECEF, one per vertex of `mesh`, whose quantized vertices lie at `positions` (ECEF).
//
// On edges, the normal is that of the gradient of the heights, by central differences over one lattice step on each
// side. A central difference is kept within 13 degrees of the limited difference (van Leer, "Towards the ultimate
// conservative difference scheme. II", 1974). The normal depends on the global node alone and is therefore equal in
// every tile that shares it. On a pole it is the ellipsoid's normal. Inside, it is the plain gradient, turned to within
// 13 degrees of the mesh's area-weighted normal: where the mesh lacks relief of the lattice, and at cliffs, shading
// must still fit the triangles.
std::vector<geo::Vec3> VertexNormals(const TileSamples& samples, const tin::TinMesh& mesh,
                                     const std::vector<geo::Vec3>& positions);

// The number of normals that are more than 13.5 degrees from the area-weighted normal of the triangles around their
// vertex.
std::size_t CountMisfits(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions,
                         const std::vector<geo::Vec3>& normals);

// VertexNormals oct-encoded.
std::vector<std::array<std::uint8_t, 2>> TileNormals(const TileSamples& samples, const tin::TinMesh& mesh,
                                                     const std::vector<geo::Vec3>& positions);

}  // namespace terrace::proto

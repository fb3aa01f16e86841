// Normals of a tile's vertices from the height lattice.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/tin/tin_mesh.h"
#include "proto/lattice_view.h"

namespace terrace::proto {

// Oct-encoded unit normals in ECEF, one per vertex of `mesh`: central differences of the heights over one lattice step on
// each side, so that they are a function of the global node and equal in every tile that shares it. On a pole the
// ellipsoid's normal.
std::vector<std::array<std::uint8_t, 2>> LatticeNormals(const LatticeView& lattice, const tin::TinMesh& mesh);

}  // namespace terrace::proto

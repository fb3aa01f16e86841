// How far flat triangles are from lattice samples along plumb lines, by brute force: the oracle of
// proto/error/tile_error.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/lattice_view.h"

namespace terrace::proto {

// Metres. `least` without the plumb lines that pass a triangle's rim within two micrometres, `most` with them.
struct FlatError {
  double least = 0, most = 0;
};

// Every node's plumb line against every triangle in ECEF, by Cramer's rule: no plane, no footprint, no order. A
// triangle that stands upright tells no height. `margin`: nodes so near to the tile's rim are left out.
FlatError LargestFlatError(const LatticeView& lattice, const std::vector<geo::Vec3>& ecef,
                           const std::vector<std::array<std::uint32_t, 3>>& triangles, int margin = 0);

}  // namespace terrace::proto

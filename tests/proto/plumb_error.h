// The distance of flat triangles from lattice samples along plumb lines by brute force, the oracle of
// proto/error/tile_error.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

// Metres. `least` ignores plumb lines that pass the rim of a triangle within two micrometres, `most` includes them.
struct FlatError {
  double least = 0, most = 0;
};

// Intersects every node's plumb line with every triangle in ECEF by Cramer's rule. A vertical triangle has no height.
// Nodes within `margin` of the tile's rim are left out.
FlatError LargestFlatError(const TileSamples& samples, const std::vector<geo::Vec3>& ecef,
                           const std::vector<std::array<std::uint32_t, 3>>& triangles, int margin = 0);

}  // namespace terrace::proto

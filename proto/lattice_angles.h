// The sines and cosines of a tile's meridians and parallels. Thousands of positions of a tile share a few hundred of
// them.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/sines.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

struct LatticeAngles {
  explicit LatticeAngles(const TileSamples& samples) {
    if (samples.angles != nullptr) {
      *this = *samples.angles;
      return;
    }
    const auto nodes = static_cast<std::size_t>(samples.cells()) + 1;
    std::vector<double> longitudes(nodes), latitudes(nodes);
    for (std::size_t k = 0; k < nodes; ++k) {
      longitudes[k] = samples.Longitude(static_cast<int>(k));
      latitudes[k] = samples.Latitude(static_cast<int>(k));
    }
    columns = geo::RoundedSinCosOf(longitudes);
    rows = geo::RoundedSinCosOf(latitudes);
  }

  std::vector<geo::SinCos> columns, rows;  // of longitudes and latitudes, by lattice column and row, 0 .. cells
};

}  // namespace terrace::proto

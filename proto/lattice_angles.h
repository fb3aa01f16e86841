// The sines and cosines of a tile's meridians and parallels. Thousands of positions of a tile share a few hundred of
// them.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/lattice_view.h"

namespace terrace::proto {

struct LatticeAngles {
  explicit LatticeAngles(const LatticeView& lattice) {
    columns.reserve(static_cast<std::size_t>(lattice.cells()) + 1);
    rows.reserve(static_cast<std::size_t>(lattice.cells()) + 1);
    for (int k = 0; k <= lattice.cells(); ++k) {
      columns.push_back(geo::RoundedSinCos(lattice.Longitude(k)));
      rows.push_back(geo::RoundedSinCos(lattice.Latitude(k)));
    }
  }

  std::vector<geo::SinCos> columns, rows;  // of longitudes and latitudes, by lattice column and row, 0 .. cells
};

}  // namespace terrace::proto

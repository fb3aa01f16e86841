// The sample lattice of a level: where the height samples of its tiles lie on the globe.
//
// A tile has cells x cells lattice cells, cells + 1 samples along an edge; neighbours share their edge samples. Global
// columns count eastwards from -180 degrees, modulo 360 degrees; global rows count northwards from -90 degrees.
#pragma once

#include <cstdint>

#include "engine/geo/tile_key.h"

namespace terrace::geo {

struct Lattice {
  int level = 0;
  int cells = 256;  // per tile edge: 256, 128, 64 or 32

  // Global samples around the Earth, and from pole to pole less one.
  std::int64_t columns() const { return TileColumns(level) * cells; }
  std::int64_t rows() const { return TileRows(level) * cells; }

  double StepDegrees() const;  // between samples, in both axes

  // Degrees of a global column, wrapped into -180 (inclusive) .. 180; of a global row, clamped to the poles. The same
  // column gives the same bits whichever tile asks.
  double Longitude(std::int64_t column) const;
  double Latitude(std::int64_t row) const;

  // Global column and row of a tile's south-western sample.
  std::int64_t FirstColumn(const TileKey& key) const { return key.x * cells; }
  std::int64_t FirstRow(const TileKey& key) const { return key.y * cells; }
};

}  // namespace terrace::geo

// The sample lattice of a level: the positions on the globe of its tiles' height samples.
//
// A tile has cells x cells lattice cells, cells + 1 samples along an edge; neighbours share their edge samples. Global
// columns count eastwards from -180 degrees, modulo 360 degrees; global rows count northwards from -90 degrees.
#pragma once

#include <cstdint>

#include "engine/geo/tile_key.h"

namespace terrace::geo {

struct Lattice {
  int level = 0;
  int cells = 256;  // along a tile's edge: 256, 128, 64 or 32; for images the pixels of a tile

  // The number of samples around the Earth, and of cells from pole to pole.
  std::int64_t columns() const { return TileColumns(level) * cells; }
  std::int64_t rows() const { return TileRows(level) * cells; }

  double StepDegrees() const;  // between samples, in both axes

  // Degrees of a global column, wrapped into -180 (inclusive) .. 180; degrees of a global row, clamped to the poles.
  // Columns a turn apart have the same longitude, bit for bit.
  double Longitude(std::int64_t column) const;
  double Latitude(std::int64_t row) const;

  // The global column and row of a tile's south-western sample.
  std::int64_t FirstColumn(const TileKey& key) const { return key.x * cells; }
  std::int64_t FirstRow(const TileKey& key) const { return key.y * cells; }
};

}  // namespace terrace::geo

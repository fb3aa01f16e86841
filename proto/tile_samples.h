// The height samples of one tile with a halo of one sample, as the encoders see them.
#pragma once

#include <cstddef>
#include <span>

#include "engine/geo/lattice.h"
#include "engine/geo/tile_key.h"

namespace terrace::proto {

struct LatticeAngles;

// A view: does not own the heights.
struct TileSamples {
  geo::TileKey key;
  geo::Lattice lattice;
  std::span<const float> heights;  // (cells + 3)^2, row by row from the south-western halo sample
  // Sines and cosines of this lattice's nodes; must outlive this object. Null: each function that needs them computes
  // them.
  const LatticeAngles* angles = nullptr;

  int cells() const { return lattice.cells; }

  // i, j in -1 .. cells + 1: columns from the west, rows from the SOUTH.
  float At(int i, int j) const {
    const auto stride = static_cast<std::size_t>(lattice.cells) + 3;
    return heights[static_cast<std::size_t>(j + 1) * stride + static_cast<std::size_t>(i + 1)];
  }
  // The row's samples from column 0 on. The halo samples lie before and after them.
  const float* Row(int j) const { return heights.data() + static_cast<std::ptrdiff_t>(j + 1) * (cells() + 3) + 1; }
  double Longitude(int i) const { return lattice.Longitude(lattice.FirstColumn(key) + i); }
  double Latitude(int j) const { return lattice.Latitude(lattice.FirstRow(key) + j); }
};

}  // namespace terrace::proto

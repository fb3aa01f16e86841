// Smooth surfaces over voids of a grid: harmonic ones, whose heights are the mean of their four neighbours'. They stay
// between the heights around the void, and go on with a plane (docs/decisions/0015-voids.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/dem/raster/sample_grid.h"

namespace terrace::dem {

// Part of a grid.
struct VoidGrid {
  GridWindow window;
  std::vector<float> heights;         // NaN: none, and none is wanted where `unknown` is 0
  std::vector<std::uint8_t> unknown;  // 1: a height is wanted; one that is there does not count

  std::size_t At(std::int64_t column, std::int64_t row) const {
    return static_cast<std::size_t>((row - window.row) * window.columns + column - window.column);
  }
};

// Unknown samples that hang together by their sides.
struct VoidRegion {
  // Along an axis: those of up to so many are solved, larger ones need a guess from a coarser grid.
  static constexpr std::int64_t kMaxSolved = 128;

  std::vector<std::size_t> samples;  // of the grid, ascending
  GridWindow box;                    // around them
  bool is_cut = false;               // they reach a side of the grid behind which it goes on

  bool is_large() const { return box.columns > kMaxSolved || box.rows > kMaxSolved; }
  // More must be seen of it to know whether it is large.
  bool is_open() const { return is_cut && !is_large(); }
};

// Sides of a grid's window behind which the grid goes on.
struct OpenSides {
  bool west = false, north = false, east = false, south = false;
};

// Regions with a sample in `core`, by their first sample.
std::vector<VoidRegion> RegionsIn(const VoidGrid& grid, const GridWindow& core, const OpenSides& open);

// Gives a region its harmonic heights. What comes out depends on the region and the heights beside it alone; the
// samples stay NaN where nothing is beside it. Precondition: !region.is_cut && !region.is_large().
void Solve(const VoidRegion& region, VoidGrid& grid);

// Moves samples that have a guess towards the mean of their neighbours, kSweeps times: each then depends on those
// within kSweeps of it. Others stay as they are, and count unless they are NaN.
inline constexpr int kSweeps = 8;
void Relax(const std::vector<std::size_t>& samples, VoidGrid& grid);

}  // namespace terrace::dem

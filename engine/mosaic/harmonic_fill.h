// Fills voids of a grid with harmonic surfaces: each height is the mean of its four neighbours. Such a surface stays
// between the heights around the void and continues a plane exactly (docs/decisions/0015-voids.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/mosaic/window_values.h"
#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// A window of a grid.
struct WindowWithHoles {
  GridWindow window;
  std::vector<float> heights;         // NaN: no height
  std::vector<std::uint8_t> unknown;  // 1: a height is to be computed, and `heights` is ignored; 0: nothing to compute

  std::size_t At(std::int64_t column, std::int64_t row) const { return IndexIn(window, column, row); }
};

// A set of unknown samples connected by their sides.
struct VoidRegion {
  // The largest extent along an axis that is solved directly. Larger regions need an initial guess from a coarser grid.
  static constexpr std::int64_t kMaxSolved = 128;

  std::vector<std::size_t> samples;  // of the grid, ascending
  GridWindow box;                    // around them
  bool is_cut = false;               // the region reaches a side of the window behind which the grid continues

  bool is_large() const { return box.columns > kMaxSolved || box.rows > kMaxSolved; }
  // Whether the window is too small to tell if the region is large.
  bool is_open() const { return is_cut && !is_large(); }
};

// The sides of a window behind which the grid continues.
struct OpenSides {
  bool west = false, north = false, east = false, south = false;
};

// Returns the regions with a sample in `core`, ordered by their first sample.
std::vector<VoidRegion> RegionsIn(const WindowWithHoles& grid, const GridWindow& core, const OpenSides& open);

// Computes the harmonic heights of a region. They depend only on the region and the heights beside it; if there are no
// heights beside it, its samples stay NaN. Precondition: !region.is_cut && !region.is_large().
void SolveHarmonic(const VoidRegion& region, WindowWithHoles& grid);

// Smooths samples that have an initial guess: kSweeps times, each moves towards the mean of its neighbours. A result
// depends on the samples within distance kSweeps. Other samples do not change, and are used unless they are NaN.
inline constexpr int kSweeps = 8;
void RelaxHarmonic(const std::vector<std::size_t>& samples, WindowWithHoles& grid);

}  // namespace terrace::dem

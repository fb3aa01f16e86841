// The bound that a mesh keeps at the samples of its tile.
#pragma once

#include <algorithm>

namespace terrace::tiler {

// Returns the bound that a mesh must keep at its samples so that it stays within `error_m` of the ground. It is smaller
// than `error_m`, because the heights of samples are rounded to 2^-10 m and their positions are inexact.
inline double ErrorAllowedAtSamples(double error_m) {
  constexpr double kRounding = 0x1p-11 + 0x1p-14;
  return std::max(error_m - kRounding, error_m / 2);
}

}  // namespace terrace::tiler

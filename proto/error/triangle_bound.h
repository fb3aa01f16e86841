// The largest difference between a plane and the samples near a triangle, with SIMD. It is slightly too large, and may
// depend on the instruction set: as an upper bound it decides what is measured, and no result depends on it.
#pragma once

#include <array>
#include <cstddef>

namespace terrace::proto {

// A triangle in a box of nodes. Coordinates are columns and rows from the first node of the box.
struct BoxedTriangle {
  // A side has its triangle where at + per_column x + per_row y >= 0.
  struct Side {
    float at = 0, per_column = 0, per_row = 0;
  };
  std::array<Side, 3> sides;
  float height = 0, per_column = 0, per_row = 0;  // the plane, metres
  int columns = 0, rows = 0;                      // nodes of the box
};

// The largest difference from the samples on the inner side of all three sides. `samples`: from the first node of the
// box; rows are `stride` apart, and up to 7 values behind each row of the box are read, and count if they are inside.
// Accurate to 2^-20 of the plane's rise over the box and of the result.
float LargestInTriangle(const BoxedTriangle& triangle, const float* samples, std::ptrdiff_t stride);

}  // namespace terrace::proto

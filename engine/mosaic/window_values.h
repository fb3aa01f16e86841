// Values of the samples of a window, row by row from the north.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/raster/sample_grid.h"

namespace terrace::dem {

inline std::size_t IndexIn(const GridWindow& window, std::int64_t column, std::int64_t row) {
  return static_cast<std::size_t>((row - window.row) * window.columns + column - window.column);
}

// Copies the values of `part` into those of a window that contains it.
inline void CopyInto(const std::vector<float>& values_of_part, const GridWindow& part, const GridWindow& window,
                     std::vector<float>& values) {
  for (std::int64_t row = 0; row < part.rows; ++row) {
    const auto to = static_cast<std::ptrdiff_t>(IndexIn(window, part.column, part.row + row));
    std::copy_n(values_of_part.begin() + row * part.columns, part.columns, values.begin() + to);
  }
}

}  // namespace terrace::dem

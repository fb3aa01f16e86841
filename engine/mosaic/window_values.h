// Values of the samples of a window, row by row from the north.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// The pixels of a window of averages.
inline Box PixelsOf(const GridWindow& window, int factor) {
  const auto pixel = [factor](std::int64_t average) { return static_cast<double>(average * factor); };
  return {pixel(window.column), pixel(window.row), pixel(window.column + window.columns),
          pixel(window.row + window.rows)};
}

inline std::size_t IndexIn(const GridWindow& window, std::int64_t column, std::int64_t row) {
  return static_cast<std::size_t>((row - window.row) * window.columns + column - window.column);
}

// The smallest part of `window` with all samples that `ends_in` reports; without columns if there are none.
// ends_in(row) returns the first and the last column of these samples in a row, counted from the window's first row and
// column, or nothing.
template <typename EndsIn>
GridWindow HullOf(const GridWindow& window, const EndsIn& ends_in) {
  std::int64_t west = window.columns, east = -1, north = window.rows, south = -1;
  for (std::int64_t row = 0; row < window.rows; ++row) {
    const std::optional<std::pair<std::int64_t, std::int64_t>> ends = ends_in(row);
    if (!ends) continue;
    north = std::min(north, row);
    south = row;
    west = std::min(west, ends->first);
    east = std::max(east, ends->second);
  }
  if (east < west) return {window.column, window.row, 0, 0};
  return {window.column + west, window.row + north, east - west + 1, south - north + 1};
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

// The part of a window of nodes that an edit may reach.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/common/dem_types.h"
#include "engine/geo/node_grid.h"

namespace terrace::dem {

// Positions of a window's columns and rows.
class WindowAxes {
 public:
  WindowAxes(const geo::NodeGrid& grid, const NodeWindow& window)
      : west_(grid.Longitude(window.column)), step_(grid.StepDegrees()) {
    for (int i = 0; i < window.columns; ++i) longitudes_.push_back(grid.Longitude(window.column + i));
    for (int j = 0; j < window.rows; ++j) latitudes_.push_back(grid.Latitude(window.row + j));
  }

  double longitude(int i) const { return longitudes_[static_cast<std::size_t>(i)]; }
  double latitude(int j) const { return latitudes_[static_cast<std::size_t>(j)]; }
  double step() const { return step_; }

  struct Part {
    int first_column, last_column, first_row, last_row;
  };
  // The nodes of all cells that the box touches in each turn around the Earth, from west to east: at most three parts,
  // with columns between them.
  std::vector<Part> PartsOf(const Box& box) const {
    const auto rows = static_cast<int>(latitudes_.size()), columns = static_cast<int>(longitudes_.size());
    const bool ascends = rows < 2 || latitudes_.front() < latitudes_.back();
    const auto below = std::ranges::partition_point(
        latitudes_, [&](double latitude) { return ascends ? latitude < box.min_y : latitude > box.max_y; });
    const auto above = std::ranges::partition_point(
        latitudes_, [&](double latitude) { return ascends ? latitude <= box.max_y : latitude >= box.min_y; });
    const int first_row = std::max(static_cast<int>(below - latitudes_.begin()) - 1, 0);
    const int last_row = std::min(static_cast<int>(above - latitudes_.begin()), rows - 1);
    std::vector<Part> parts;
    for (const double turn : {-360.0, 0.0, 360.0}) {
      const double first = std::floor((box.min_x + turn - west_) / step_),
                   last = std::ceil((box.max_x + turn - west_) / step_);
      if (last < 0 || first > columns - 1 || first_row > last_row) continue;
      const Part part{static_cast<int>(std::max(first, 0.0)), static_cast<int>(std::min(last, columns - 1.0)),
                      first_row, last_row};
      // Parts that adjoin are one, because the cells between them belong to both.
      if (!parts.empty() && part.first_column <= parts.back().last_column + 1) {
        parts.back().last_column = std::max(parts.back().last_column, part.last_column);
      } else {
        parts.push_back(part);
      }
    }
    return parts;
  }

 private:
  double west_, step_;
  std::vector<double> longitudes_, latitudes_;
};

}  // namespace terrace::dem

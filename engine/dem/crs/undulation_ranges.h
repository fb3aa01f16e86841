// Bounds on the undulations of a grid over boxes, computed from the grid's nodes.
#pragma once

#include "engine/core/result.h"
#include "engine/dem/common/range_table.h"
#include "engine/dem/crs/footprint.h"
#include "engine/dem/crs/undulation_grid.h"
#include "engine/dem/dem_types.h"

namespace terrace::dem {

// Immutable and thread-safe.
class UndulationRanges {
 public:
  // Reads the nodes in and around the area.
  static Result<UndulationRanges> Of(const UndulationGrid& grid, const Footprint& area);

  // Returns a range that contains all undulations in the intersection of the area and a box with south-western corner
  // (west, south), `width` by `height` degrees; west counts modulo 360. min > max: the box does not meet the area, or
  // nothing is known there.
  HeightRange Query(double west, double south, double width, double height) const;

  HeightRange whole() const { return whole_; }
  bool is_complete() const { return is_complete_; }  // known in the whole area

 private:
  explicit UndulationRanges(const UndulationGrid& grid) : grid_(&grid) {}

  const UndulationGrid* grid_;  // outlives this
  int first_column_ = 0, first_row_ = 0;
  RangeTable table_;
  HeightRange whole_;
  bool is_complete_ = false;
};

}  // namespace terrace::dem

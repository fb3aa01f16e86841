// The undulation of a source's geoid at the nodes of lattices and grids, and bounds on it.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/common/range_table.h"
#include "engine/core/result.h"
#include "engine/crs/footprint.h"
#include "engine/crs/geoid.h"
#include "engine/crs/undulation_grid.h"
#include "engine/geo/node_grid.h"

namespace terrace::dem {

// Bounds on the undulations of a grid over boxes, computed from the grid's nodes. Immutable and thread-safe.
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

// Immutable after construction and thread-safe.
// If the geoid is a grid (geoid.h), undulations are interpolated between its nodes, as PROJ does, and bounds are the
// minimum and maximum of its nodes. Other PROJ operations are evaluated at every node. If lattice cells are smaller
// than the cells of every grid that the operation reads, only a few nodes are evaluated, and the others are
// interpolated bilinearly within kTolerance.
class Undulations {
 public:
  // Metres: the largest interpolation error for geoids that are not a grid.
  static constexpr double kTolerance = 0.002;

  // `area`: where undulations will be evaluated, up to the whole Earth. kUnavailable: the grid cannot be read.
  static Result<std::shared_ptr<const Undulations>> Of(std::shared_ptr<const Geoid> geoid, const Footprint& area);
  // For the whole Earth, without bounds: use only At and AtPole.
  static Result<std::shared_ptr<const Undulations>> OfEarth(std::shared_ptr<const Geoid> geoid);

  // Returns the undulations of the window's nodes, row by row; NaN outside the area and where the geoid is not known. A
  // value depends only on the global node and has the same bits in every window. All nodes of a pole row have the same
  // value.
  Result<std::vector<double>> At(const geo::NodeGrid& grid, const NodeWindow& window) const;

  // Returns a range that contains all values of At in a box with south-western corner (west, south), `width` by
  // `height` degrees; west counts modulo 360. If the box does not meet the area, the range of the whole area.
  HeightRange RangeOf(double west, double south, double width, double height) const;

  double AtPole(int pole) const { return poles_[pole]; }  // 0 south, 1 north; NaN where not known
  // Whether the geoid is known in the whole area.
  bool is_complete() const { return ranges_ ? ranges_->is_complete() : is_complete_; }
  // Whether RangeOf bounds the geoid itself and not only the values of At: the geoid was evaluated at the resolution of
  // its grids.
  bool bounds_geoid() const { return ranges_.has_value() || bounds_geoid_; }

  const Geoid& geoid() const { return *geoid_; }

 private:
  Undulations(std::shared_ptr<const Geoid> geoid, const Footprint& area) : geoid_(std::move(geoid)), area_(area) {}
  Result<void> FindPoles();
  void Evaluate(const geo::NodeGrid& grid, const NodeWindow& window, std::vector<double>& out) const;
  Result<void> Interpolate(const geo::NodeGrid& grid, const NodeWindow& window, std::vector<double>& out) const;
  double EastOfArea(double longitude) const;  // degrees, 0 .. 360
  bool IsInside(double longitude, double latitude) const;
  const HeightRange& BoxAt(double longitude, double latitude) const;
  HeightRange& Box(int column, int row) { return boxes_[IndexAt(column, row, columns_)]; }
  const HeightRange& Box(int column, int row) const { return const_cast<Undulations&>(*this).Box(column, row); }
  void FillBoxes();

  std::shared_ptr<const Geoid> geoid_;
  Footprint area_;
  std::optional<UndulationRanges> ranges_;  // of a grid
  // For other geoids: bounds over equal boxes of the area, row by row from the south-western box. At clamps its results
  // to these bounds, so that they hold for At even if the geoid exceeds them between the evaluated positions.
  int columns_ = 0, rows_ = 0;
  std::vector<HeightRange> boxes_;
  HeightRange whole_;
  bool is_complete_ = true, bounds_geoid_ = false;
  double poles_[2];  // south, north; NaN where not known
};

}  // namespace terrace::dem

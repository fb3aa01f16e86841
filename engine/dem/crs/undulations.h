// The undulation of a source's geoid at the nodes of lattices and grids, and bounds on it.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/common/range_table.h"
#include "engine/dem/crs/footprint.h"
#include "engine/dem/crs/geoid.h"
#include "engine/dem/crs/undulation_grid.h"
#include "engine/dem/dem_types.h"
#include "engine/geo/lattice.h"
#include "engine/geo/mercator_grid.h"

namespace terrace::dem {

// Bounds on a grid of undulations over boxes, from the grid's own nodes. Immutable and thread-safe.
class UndulationRanges {
 public:
  // Reads the nodes in and around the area once.
  static Result<UndulationRanges> Of(const UndulationGrid& grid, const Footprint& area);

  // No undulation in the box and the area leaves it: from (west, south), degrees, `width` by `height` large; west
  // counts modulo 360. min > max: the box misses the area, or nothing is known there.
  HeightRange Query(double west, double south, double width, double height) const;

  HeightRange whole() const { return whole_; }
  bool is_complete() const { return is_complete_; }  // known all over the area

 private:
  explicit UndulationRanges(const UndulationGrid& grid) : grid_(&grid) {}

  const UndulationGrid* grid_;  // outlives this
  int first_column_ = 0, first_row_ = 0;
  RangeTable table_;
  HeightRange whole_;
  bool is_complete_ = false;
};

// Immutable after construction and thread-safe.
//
// Where the geoid is a grid (geoid.h), undulations are interpolated between its nodes, as PROJ does, and bounds are the
// lowest and highest of its nodes. Other operations of PROJ are asked themselves, at nodes or, where cells of nodes are
// smaller than those of any grid they read, at a few of them and between these bilinearly, within kTolerance.
class Undulations {
 public:
  // Of undulations that are not those of a grid: metres from the geoid's own.
  static constexpr double kTolerance = 0.002;

  // `area`: where undulations will be asked for; the whole Earth is possible. kUnavailable: the grid cannot be read.
  static Result<std::shared_ptr<const Undulations>> Of(std::shared_ptr<const Geoid> geoid, const Footprint& area);
  // All over the Earth, for At and AtPole alone: no bounds are looked for.
  static Result<std::shared_ptr<const Undulations>> OfEarth(std::shared_ptr<const Geoid> geoid);

  // Of the window's nodes, row by row from its first; NaN outside the area and where the geoid is not known. A function
  // of the global node alone: whichever window asks gets the same bits; pole rows are one value.
  // `Grid`: geo::Lattice or geo::MercatorGrid.
  template <typename Grid>
  Result<std::vector<double>> At(const Grid& grid, const NodeWindow& window) const;

  // No value of At within the box leaves it: from (west, south), degrees, `width` by `height` large; west counts modulo
  // 360. Of a box that misses the area: of the whole area.
  HeightRange RangeOf(double west, double south, double width, double height) const;

  double AtPole(int pole) const { return poles_[pole]; }  // 0 south, 1 north; NaN where not known
  // Whether the geoid is known all over the area.
  bool is_complete() const { return ranges_ ? ranges_->is_complete() : is_complete_; }
  // RangeOf bounds the geoid itself, and not just what At gives: it was looked at as closely as its grids can bend.
  bool bounds_geoid() const { return ranges_.has_value() || bounds_geoid_; }

  const Geoid& geoid() const { return *geoid_; }

 private:
  Undulations(std::shared_ptr<const Geoid> geoid, const Footprint& area) : geoid_(std::move(geoid)), area_(area) {}
  Result<void> FindPoles();
  template <typename Grid>
  void Ask(const Grid& grid, const NodeWindow& window, std::vector<double>& out) const;
  template <typename Grid>
  Result<void> Interpolate(const Grid& grid, const NodeWindow& window, std::vector<double>& out) const;
  double EastOfArea(double longitude) const;  // degrees, 0 .. 360
  bool IsInside(double longitude, double latitude) const;
  const HeightRange& BoxAt(double longitude, double latitude) const;
  HeightRange& Box(int column, int row) { return boxes_[Area(row, columns_) + static_cast<std::size_t>(column)]; }
  const HeightRange& Box(int column, int row) const { return const_cast<Undulations&>(*this).Box(column, row); }
  void FillBoxes();

  std::shared_ptr<const Geoid> geoid_;
  Footprint area_;
  std::optional<UndulationRanges> ranges_;  // of a grid
  // Of other geoids: bounds over equal boxes of the area, row by row from the south-western one. What At interpolates
  // is held within them: they are bounds by construction, even should a geoid bulge unseen between the positions they
  // were taken from.
  int columns_ = 0, rows_ = 0;
  std::vector<HeightRange> boxes_;
  HeightRange whole_;
  bool is_complete_ = true, bounds_geoid_ = false;
  double poles_[2];  // south, north; NaN where not known
};

}  // namespace terrace::dem

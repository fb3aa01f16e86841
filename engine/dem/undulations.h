// The undulation of a source's geoid at the nodes of lattices and grids, and bounds on it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "engine/dem/dem_source.h"
#include "engine/dem/footprint.h"
#include "engine/dem/geoid.h"
#include "engine/geo/lattice.h"
#include "engine/geo/mercator_grid.h"

namespace terrace::dem {

// Immutable after construction and thread-safe.
class Undulations {
 public:
  // Interpolated undulations are this close to the geoid's own, in metres.
  static constexpr double kTolerance = 0.002;

  // `area`: where undulations will be asked for; the whole Earth is possible.
  Undulations(std::shared_ptr<const Geoid> geoid, const Footprint& area);

  // Of the window's nodes, row by row from its first; NaN outside the area and where the geoid is not known. A function
  // of the global node alone: whichever window asks gets the same bits; pole rows are one value.
  //
  // The geoid is evaluated at the corners of global cells of 32 x 32 nodes and at the middles between them, and
  // interpolated bilinearly where that is within half of kTolerance there; other cells are divided, down to the nodes.
  std::vector<double> At(const geo::Lattice& lattice, const NodeWindow& window) const;
  std::vector<double> At(const geo::MercatorGrid& grid, const NodeWindow& window) const;

  // No value of At within the box leaves it: from (west, south), degrees, `width` by `height` large; west counts modulo
  // 360. Of a box that misses the area: of the whole area.
  HeightRange RangeOf(double west, double south, double width, double height) const;

  double AtPole(int pole) const { return poles_[pole]; }  // 0 south, 1 north; NaN where not known
  // Whether the geoid is known all over the area.
  bool is_complete() const { return is_complete_; }

  const Geoid& geoid() const { return *geoid_; }

 private:
  template <typename Grid>
  std::vector<double> AtNodes(const Grid& grid, const NodeWindow& window) const;
  double EastOfArea(double longitude) const;  // degrees, 0 .. 360
  bool IsInside(double longitude, double latitude) const;
  const HeightRange& BoxAt(double longitude, double latitude) const;
  HeightRange& Box(int column, int row) {
    return boxes_[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                  static_cast<std::size_t>(column)];
  }
  const HeightRange& Box(int column, int row) const { return const_cast<Undulations&>(*this).Box(column, row); }
  void FillBoxes();

  std::shared_ptr<const Geoid> geoid_;
  Footprint area_;
  // Bounds over equal boxes of the area, row by row from the south-western one. What At interpolates is held within
  // them: they are bounds by construction, even should a geoid bulge unseen between the positions they were taken from.
  int columns_ = 0, rows_ = 0;
  std::vector<HeightRange> boxes_;
  HeightRange whole_;
  bool is_complete_ = true;
  double poles_[2];  // south, north; NaN where not known
};

}  // namespace terrace::dem

// An upper bound on the distance between an edge and the lattice surface, computed with SIMD from the crossings of the
// edge with the lattice's lines. It is slightly too large; most edges need no exact measurement.
#pragma once

#include <cstdint>
#include <memory>

#include "proto/tile_samples.h"

namespace terrace::proto {

// Lattice columns and rows, from the tile's south-western sample.
struct LatticePoint {
  double x = 0, y = 0;
};

// Where an edge crosses the lattice's lines of one direction: the columns or the rows.
struct LatticeCrossings {
  double from, to;                  // the coordinate across the lines at the first and the last end, lattice steps
  double along_from, along_change;  // the coordinate along the lines at the first end; last minus first
  double height, rise;              // of the edge at the first end; last minus first; metres
  // Between two crossings the lattice surface differs from the straight line through its heights at the crossings by at
  // most bend * twist, where twist is the coefficient of xy of the cell's surface. No unit.
  double bend;
  const float *heights, *twists;   // metres, from the tile's south-western sample and cell
  std::int32_t line_stride, step;  // index = line * line_stride + cell * step
  int cells;                       // along a line
};

class EdgeBound {
 public:
  // `samples` must outlive this object.
  explicit EdgeBound(const TileSamples& samples);

  // A vertex, prepared once for all its edges.
  struct End {
    LatticePoint place;
    double height = 0;
    double error = 0;  // metres between the height and the lattice surface
    double twist = 0;  // of the cells around
  };
  // Precondition: the place is on the tile.
  End EndAt(LatticePoint place, double height) const;

  // An upper bound on the difference between the lattice surface and the height that is linear from end to end.
  double Over(const End& a, const End& b) const;

  // The largest steps, in metres, between neighbouring samples of a row and of a column. Exact: heights are multiples
  // of 2^-10 m, and differences are below 2^14 m.
  double steepest_east() const { return steepest_east_; }
  double steepest_north() const { return steepest_north_; }

 private:
  const TileSamples& samples_;
  float steepest_east_ = 0, steepest_north_ = 0;
  // By node, in the order of TileSamples::heights: the largest |twist| of a cell at the node. A cell's twist is the
  // coefficient of xy of its surface.
  std::unique_ptr<float[]> twists_;
};

}  // namespace terrace::proto

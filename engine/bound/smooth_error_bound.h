// Error bound for tile cells whose nodes are regular: nodes that took their heights from the raster grid, and lie where
// its averages are evenly spaced. The bound follows from the second differences of the samples: they limit how far the
// surface between nodes departs from the one between samples.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/bound/column_differences.h"
#include "engine/bound/geoid_error_bound.h"
#include "engine/bound/grid_statistics.h"
#include "engine/bound/node_steps.h"
#include "engine/bound/tile_cells.h"
#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {

class SmoothErrorBound {
 public:
  // `blends`: raster grids are blended where they meet. The other arguments must outlive this object.
  SmoothErrorBound(const TileNodes& tile, const RasterGrid& grid, const GridReading& reading,
                   const GridStatistics& statistics, const GeoidErrorBound& geoid, bool blends);

  // Makes BoundOver faster for boxes of cell rows `south` to `north`. Results do not depend on it.
  void PrepareRows(int south, int north);

  // Returns a bound in metres on the difference between served heights and the raster grid's samples. NaN or infinity:
  // no bound is known, because a node is not regular, a sample is void or the geoid is not known.
  double BoundOver(const CellBox& box);

  // Returns the bounds of the box's nodes, in averages; empty if one of them is not regular.
  PixelBounds BoundsOf(const CellBox& box) const;

 private:
  // Largest first (x, y) and second (xx, yy, xy) differences of the samples in a box, in metres.
  struct Differences {
    double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  };
  double EvenColumn(std::int64_t column, double weight) const;
  double EvenRow(std::int64_t row, double weight) const;
  void PlaceColumnsAndRows();
  Position PlaceOf(std::size_t i, std::size_t j) const;
  bool GaveHeights(std::size_t row, std::size_t first, std::size_t end) const;
  bool GaveHeights(const CellBox& box) const;
  bool MeasureNodes(const CellBox& box, NodeSteps& steps, PixelBounds& at) const;
  bool MeasureAxes(const CellBox& box, NodeSteps& steps, PixelBounds& at) const;
  // Returns false if a node or a neighbour of one is not regular.
  bool Measure(const CellBox& box, NodeSteps& steps, PixelBounds& at) const;
  SampleBox AveragesIn(const PixelBounds& at) const;
  SampleBox Clipped(SampleBox range) const;
  // Returns false if one of the averages is void, or none was read.
  bool Measure(const SampleBox& range, Differences& differences);
  void MeasureColumns(const SampleBox& range, ColumnDifferences& differences) const;
  static double Largest(const Differences& differences, const NodeSteps& steps);
  double LargestBlend(const CellBox& box) const;

  const TileNodes tile_;
  const GridReading& reading_;
  const GridStatistics& statistics_;
  const GeoidErrorBound& geoid_;
  const bool blends_;
  const double position_error_;  // in averages
  const Position misplacement_;  // of samples, in averages
  const bool is_even_around_;    // averages are evenly spaced around the Earth
  Position last_;                // the last place of each axis where averages are evenly spaced
  std::vector<double> x_, y_;    // if separable, the places of the tile's columns and rows; NaN if not regular
  int known_south_ = 0, known_north_ = -1;  // rows of cells whose nodes all have heights, of those prepared

  // By column of the reading's window, over rows `top` to `bottom` of the averages.
  struct Band : ColumnDifferences {
    std::int64_t top = 0, bottom = -1;
  };
  Band band_;
  ColumnDifferences box_;  // of the box that was measured last
};

}  // namespace terrace::dem

// Where a tile's nodes lie evenly on a raster grid's grid: the surface between nodes and the one between averages
// differ by no more than either bends.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/dem/bound/geoid_error_bound.h"
#include "engine/dem/bound/grid_tables.h"
#include "engine/dem/bound/tile_cells.h"
#include "engine/dem/mosaic/raster_grid.h"

namespace terrace::dem {

class SmoothErrorBound {
 public:
  // `blends`: raster grids are blended where one gives way to the next. What the others refer to outlives it.
  SmoothErrorBound(const TileNodes& tile, const RasterGrid& grid, const GridTrace& trace, const GridTables& tables,
                   const GeoidErrorBound& geoid, bool blends);

  // Between the heights served and the raster grid's samples; NaN or infinity where the box is no such place.
  double Over(const CellBox& box) const;

  // Of the nodes of a box, in averages; none where one of them is away from the even part.
  PixelBounds BoundsOf(const CellBox& box) const;

 private:
  // How much a surface between samples can bend, from the samples of a box: largest differences.
  struct Bends {
    double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  };
  // What the node positions of a box of cells say: how far it is from one node to the next, in samples, and how far
  // a place may be from where even steps have it.
  struct Steps {
    double east_x = 0, east_y = 0, north_x = 0, north_y = 0, bend_x = 0, bend_y = 0;
  };

  void PlaceNodes(const RasterGrid& grid);
  // False where a node is not placed.
  bool Measure(const CellBox& box, Steps& steps, PixelBounds& at) const;
  // Of samples left .. right, top .. bottom, which surround the box; false where one of them is void.
  bool Measure(std::int64_t left, std::int64_t top, std::int64_t right, std::int64_t bottom, Bends& bends) const;
  static double Largest(const Bends& bends, const Steps& steps);
  double LargestBlend(const CellBox& box) const;

  const TileNodes tile_;
  const GridTrace& trace_;
  const GridTables& tables_;
  const GeoidErrorBound& geoid_;
  const bool blends_;
  const Position misplacement_;  // of samples, in averages
  std::vector<double> x_, y_;    // by node, in samples of the grid; NaN away from its even part
};

}  // namespace terrace::dem

// Error bound for single tile cells, for nodes that are not evenly spaced on the raster grid: the largest difference
// between served heights and the raster grid's samples.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/bound/geoid_error_bound.h"
#include "engine/bound/grid_statistics.h"
#include "engine/bound/tile_cells.h"
#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {

// Bounds are in metres. `known`: the bound that the tile has already, which smaller ones do not change. A bound of at
// most `known` may be returned as any value from 0 to `known`.
class CellErrorBound {
 public:
  // The arguments must outlive this object.
  CellErrorBound(const TileNodes& tile, const RasterGrid& grid, const GridReading& reading,
                 const GridStatistics& statistics, const GeoidErrorBound& geoid)
      : tile_(tile),
        grid_(grid),
        reading_(reading),
        statistics_(statistics),
        geoid_(geoid),
        columns_(GridAxis(grid.columns(), reading.factor, grid.wraps()).count()),
        rows_(GridAxis(grid.rows(), reading.factor, false).count()) {}

  // Returns a bound from the averages that the cell's nodes are interpolated from: the surface lies between the
  // averages, and the samples lie within the averaging error of it. Sets `has_voids` if some averages are void.
  // Precondition: all nodes of the cell took their height from the raster grid.
  double BoundByAverages(const TileCell& cell, bool& has_voids) const;

  // The positions of a cell's nodes in pixels, and the samples that may lie in the cell.
  struct CellSamples {
    std::array<Position, 4> corners;
    SampleBox samples;
    bool between = false;  // heights between samples count as well
  };

  // Returns a bound for any cell from the statistics, averages and samples that were read. `between`: heights
  // between samples count like samples, for example because the raster grid is blended in the cell. `fills`: filled
  // voids count too. Sets `cell_samples` if BoundBySamples can give a tighter bound from samples that have not been
  // read.
  double BoundBySurroundings(const TileCell& cell, bool between, bool fills, double known,
                             std::optional<CellSamples>& cell_samples) const;

  // Whether BoundBySurroundings returns 0 for every cell of a box, because all samples around them are voids, as on the
  // sea. Precondition: nothing is blended. False does not mean the contrary.
  bool HasNoSamples(const CellBox& box) const;

  // Returns a bound from the samples in the cell. Infinite if some of them lie outside the window. `column_offset`: is
  // added to the columns of `cell_samples`, for windows one turn around the Earth further on.
  double BoundBySamples(const TileCell& cell, const CellSamples& cell_samples, const GridWindow& window,
                        const std::vector<float>& samples, std::int64_t column_offset, double known) const;

 private:
  std::optional<std::array<Position, 4>> CornersOf(const TileCell& cell) const;
  bool IsOnBothEnds(const PixelBounds& box) const;
  SampleBox Clipped(SampleBox box) const;
  double DistanceBound(const TileCell& cell, double lowest, double highest) const;
  double BoundByBox(const TileCell& cell, const SampleBox& averages, bool& has_voids) const;
  double BoundByAveragesNear(const TileCell& cell, const PixelBounds& box) const;

  const TileNodes tile_;
  const RasterGrid& grid_;
  const GridReading& reading_;
  const GridStatistics& statistics_;
  const GeoidErrorBound& geoid_;
  const std::int64_t columns_, rows_;  // of averages of the reading's factor
};

}  // namespace terrace::dem

// Where a tile's nodes do not lie evenly on a raster grid: single cells, between the heights served and the
// raster grid's samples.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/dem/bound/geoid_error_bound.h"
#include "engine/dem/bound/grid_tables.h"
#include "engine/dem/bound/tile_cells.h"
#include "engine/dem/mosaic/raster_grid.h"

namespace terrace::dem {

// Columns and rows of a raster grid's samples, ends included; columns of raster grids that wrap may lie a turn on.
struct SampleBox {
  std::int64_t west = 0, north = 0, east = -1, south = -1;

  bool empty() const { return west > east || north > south; }
  std::int64_t columns() const { return east - west + 1; }
  std::int64_t rows() const { return south - north + 1; }
  SampleBox Around(const SampleBox& other) const {
    if (empty()) return other;
    if (other.empty()) return *this;
    return {std::min(west, other.west), std::min(north, other.north), std::max(east, other.east),
            std::max(south, other.south)};
  }

  friend bool operator==(const SampleBox&, const SampleBox&) = default;
};

class CellErrorBound {
 public:
  // What these refer to outlives it.
  CellErrorBound(const TileNodes& tile, const RasterGrid& grid, const GridTrace& trace, const GridTables& tables,
                 const GeoidErrorBound& geoid)
      : tile_(tile),
        grid_(grid),
        trace_(trace),
        tables_(tables),
        geoid_(geoid),
        columns_(GridAxis(grid.columns(), trace.factor, grid.wraps()).count()),
        rows_(GridAxis(grid.rows(), trace.factor, false).count()) {}

  // By the averages that the cell's nodes are interpolated from: the surface is between them, and the samples that
  // they stand for within their error of it. `has_voids`: not all of them are there. Precondition: all of the cell's
  // nodes took their height from the raster grid.
  double OfAverages(const TileCell& cell, bool& has_voids) const;

  // A cell's nodes in pixels, and the samples that may lie in it.
  struct CellSamples {
    std::array<Position, 4> corners;
    SampleBox samples;
    bool between = false;  // heights between samples count as well
  };

  // By what tables, averages and samples say that were read, of any cell. `gives_way`: the raster grid is blended
  // there, and its height between samples counts as they do. `fills`: what is filled in counts too. `place`: set where
  // OfSamples may tell more, of samples that are read for that.
  double OfSurroundings(const TileCell& cell, bool gives_way, bool fills, std::optional<CellSamples>& place) const;

  // By the samples in the cell themselves; infinite where not all of them are in the window. `turn`: how many columns
  // on the window's samples are.
  double OfSamples(const TileCell& cell, const CellSamples& place, const GridWindow& window,
                   const std::vector<float>& samples, std::int64_t turn) const;

 private:
  std::optional<std::array<Position, 4>> CornersOf(const TileCell& cell) const;
  bool IsOnBothEnds(const PixelBounds& box) const;
  SampleBox Clipped(SampleBox box) const;
  double Apart(const TileCell& cell, double lowest, double highest) const;
  double OfBox(const TileCell& cell, const SampleBox& averages, bool& has_voids) const;
  double OfAveragesNear(const TileCell& cell, const PixelBounds& box) const;

  const TileNodes tile_;
  const RasterGrid& grid_;
  const GridTrace& trace_;
  const GridTables& tables_;
  const GeoidErrorBound& geoid_;
  const std::int64_t columns_, rows_;  // of averages of the trace's factor
};

}  // namespace terrace::dem

// Cells whose bound, told from averages and tables, may be improved by reading their samples: at the joints of averaged
// rasters, at rims and beside voids.
#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/bound/cell_error_bound.h"

namespace terrace::dem {

class LooseCells {
 public:
  // Averages of more samples are judged by tables, whose blocks are as fine.
  static bool MayRead(int factor) { return factor > 1 && factor <= 16; }

  // What these refer to outlives it.
  LooseCells(const RasterGrid& grid, const CellErrorBound& single) : grid_(grid), single_(single) {}

  // Cells of a group lie beside each other: their samples are read together.
  void BeginGroup() { groups_.emplace_back(); }

  // `error`: what is known. Precondition: a group has begun.
  void Add(const TileCell& cell, const CellErrorBound::CellSamples& place, double error);

  // Raises `bound` to that of all cells, reading no more than that needs and no more than a bounded number of samples.
  // kUnavailable: a raster cannot be read now. kCancelled: stopped.
  Result<void> Read(double& bound, const std::stop_token& stop);

 private:
  struct Cell {
    TileCell cell;
    CellErrorBound::CellSamples place;
    double error;
  };
  struct Group {
    std::vector<Cell> cells;
    double error = 0;
  };

  const RasterGrid& grid_;
  const CellErrorBound& single_;
  std::vector<Group> groups_;
};

}  // namespace terrace::dem

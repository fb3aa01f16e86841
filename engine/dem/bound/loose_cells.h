// Cells with a loose bound, at joints of averaged rasters, at rims and beside voids. Reading their samples tightens it.
#pragma once

#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/bound/cell_error_bound.h"

namespace terrace::dem {

class LooseCells {
 public:
  // For larger factors the blocks of the statistics are as fine as the cells.
  static bool MayRead(int factor) { return factor > 1 && factor <= 16; }

  // The arguments must outlive this.
  LooseCells(const RasterGrid& grid, const CellErrorBound& single) : grid_(grid), single_(single) {}

  // Cells of a group are adjacent; their samples are read together.
  void BeginGroup() { groups_.emplace_back(); }

  // `error`: the known bound of the cell. Precondition: a group has begun.
  void Add(const TileCell& cell, const CellErrorBound::CellSamples& place, double error);

  // Raises `bound` to the bound of all cells. Reads only groups that could raise it, and a bounded number of samples.
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

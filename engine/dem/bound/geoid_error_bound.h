// A bound on the difference between a geoid and the bilinear surface between the undulations that were added at a
// tile's nodes.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "engine/dem/bound/tile_cells.h"
#include "engine/dem/crs/undulations.h"

namespace terrace::dem {

class GeoidErrorBound {
 public:
  // `geoid`: null if none is added. `added`: undulation per node of the tile. The arguments must outlive this object.
  GeoidErrorBound(const TileNodes& tile, const Undulations* geoid, std::span<const double> added);

  bool is_added() const { return geoid_ != nullptr; }
  double AddedAt(std::size_t node) const { return added_[node]; }

  // Returns the bound for a box. 0 if no geoid is added; infinite if undulations are not known there.
  double BoundOver(const CellBox& box) const;

  // Returns a range that contains all undulations in a box. Precondition: is_added().
  HeightRange RangeOf(const CellBox& box) const {
    return geoid_->RangeOf(tile_.West(box), tile_.South(box), tile_.Width(box), tile_.Height(box));
  }

 private:
  double OverNodes(const CellBox& box) const;
  double OverNodes(const TileCell& cell) const;
  double OverCoarse(const CellBox& box) const;
  double OverSmooth(const CellBox& box) const;

  const TileNodes tile_;
  const Undulations* const geoid_;
  const std::span<const double> added_;

  // For a geoid that is a grid: the positions of the tile's columns and rows on the grid, in grid steps, and the grid
  // nodes around them. Empty if the grid is much denser than the tile.
  std::vector<double> columns_, rows_;
  std::optional<UndulationPatch> patch_;
};

}  // namespace terrace::dem

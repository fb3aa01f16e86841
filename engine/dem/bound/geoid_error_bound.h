// How far a geoid is from what a tile adds of it.
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
  // `geoid`: null where none is added. `added`: by node of the tile. What these refer to outlives it.
  GeoidErrorBound(const TileNodes& tile, const Undulations* geoid, std::span<const double> added);

  bool is_added() const { return geoid_ != nullptr; }
  double AddedAt(std::size_t node) const { return added_[node]; }

  // How far the geoid is from the surface that is bilinear between its undulations at nodes; 0 where none are added,
  // infinite where they are not known.
  double Over(const CellBox& box) const;

  // At least that of the geoid in a box. Precondition: is_added().
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

  // Of a geoid that is a grid: where the tile's columns and rows of nodes lie on it, in its steps, and the grid's own
  // nodes around them. None where the grid's are much denser.
  std::vector<double> columns_, rows_;
  std::optional<UndulationPatch> patch_;
};

}  // namespace terrace::dem

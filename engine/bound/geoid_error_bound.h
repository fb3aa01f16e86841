// A bound on the difference between a geoid and the bilinear surface between the undulations that were added at a
// tile's nodes.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "engine/bound/tile_cells.h"
#include "engine/crs/undulation_grid.h"
#include "engine/crs/undulations.h"

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
  // The steps between nodes along one axis of the tile. Step k has the stops first[k] to first[k + 1] - 1: its ends and
  // the geoid's grid lines between them, in grid steps.
  struct Steps {
    std::vector<double> stops;
    std::vector<AxisPosition> places;
    std::vector<std::size_t> first = {0};
    std::vector<int> crossed;  // by a line, or beside a pole, ascending

    std::size_t count(int step) const {
      return first[static_cast<std::size_t>(step) + 1] - first[static_cast<std::size_t>(step)];
    }
  };

  void FindLines(const UndulationGrid& grid);
  bool IsAtPole(int row_of_cells) const;
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
  Steps column_steps_, row_steps_;
  std::optional<UndulationPatch> patch_;
  bool is_whole_ = false;  // all nodes of the patch and of the tile have undulations, and none is outside the grid
};

}  // namespace terrace::dem

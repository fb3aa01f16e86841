// Where a tile's samples lie in the source, in pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/crs/footprint.h"
#include "engine/crs/georeference.h"
#include "engine/crs/position_rows.h"
#include "engine/geo/lattice.h"
#include "engine/geo/node_grid.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// The position of nodes that a raster's CRS cannot represent: NaN.
inline constexpr Position kNowhere{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

// The largest error of a node's position, in spacings of the averages in use: times their factor, in pixels. Affine
// positions are exact but for rounding. Others are interpolated with a tolerance of 1e-5 of this spacing, which is
// checked at a few nodes of each cell. The largest measured error is 5e-5, of datums with grids of shifts.
inline double MaxPositionError(const Georeference& georeference) { return georeference.is_affine() ? 1e-9 : 1e-4; }

// The window of a tile's samples with a halo of one.
NodeWindow WindowOfTile(const geo::Lattice& lattice, const geo::TileKey& key);

// Pixel positions of a window's nodes. A position depends only on the global node and has the same bits in every
// window. Nodes are ordered row by row: lattices from the south-west, Mercator grids from the north-west. Positions are
// exact for sources in WGS 84 degrees. For other sources, 5 x 5 nodes of each global cell of up to 128 x 128 nodes are
// transformed, and the others are interpolated by polynomials of degree four. Eight more nodes are transformed to check
// this: cells where one is off by more than `tolerance` pixels are divided.
class NodePositions {
 public:
  NodePositions() = default;  // no nodes
  // `x` by column, `y` by row.
  NodePositions(const NodeWindow& window, std::vector<double> x, std::vector<double> y)
      : window_(window), x_(std::move(x)), y_(std::move(y)) {}
  // `extent`: of the nodes.
  NodePositions(const NodeWindow& window, std::vector<Position> nodes, const PositionExtent& extent)
      : window_(window), nodes_(std::move(nodes)), extent_(extent) {}
  // Positions of lattice nodes. NaN where the source's CRS has no position, and outside `footprint`. The nodes of a
  // pole row share one position unless columns are meridians.
  static NodePositions Of(const Georeference& georeference, const Footprint& footprint, const geo::NodeGrid& grid,
                          const NodeWindow& window, double tolerance);

  const NodeWindow& window() const { return window_; }
  std::size_t columns() const { return static_cast<std::size_t>(window_.columns); }
  std::size_t rows() const { return static_cast<std::size_t>(window_.rows); }

  // Whether meridians are the source's columns and parallels its rows: all nodes of a column have the same x, all nodes
  // of a row the same y.
  bool is_separable() const { return nodes_.empty(); }
  // One per column and one per row, never NaN. Precondition: is_separable().
  std::span<const double> x() const { return x_; }
  std::span<const double> y() const { return y_; }
  // One per node, rows of them, and the extent of all. Precondition: !is_separable().
  std::span<const Position> nodes() const { return nodes_; }
  const PositionExtent& extent() const { return extent_; }
  std::span<const Position> Row(std::size_t j) const { return nodes().subspan(j * columns(), columns()); }

  Position At(std::size_t i, std::size_t j) const {
    return is_separable() ? Position{x_[i], y_[j]} : nodes_[j * columns() + i];
  }
  // The position of the node at a global column and row; kNowhere outside the window.
  Position OfNode(std::int64_t column, std::int64_t row) const {
    const std::int64_t i = column - window_.column, j = row - window_.row;
    if (i < 0 || j < 0 || i >= window_.columns || j >= window_.rows) return kNowhere;
    return At(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }

 private:
  NodeWindow window_;
  std::vector<double> x_, y_;
  std::vector<Position> nodes_;
  PositionExtent extent_;  // of nodes_
};

// Returns the pixel positions of the centres of the tile's lattice cells, without a halo: an image of the tile is
// sampled there. Row by row from the south-western cell; NaN as in NodePositions.
std::vector<Position> CellCentrePositions(const Georeference& georeference, const Footprint& footprint,
                                          const geo::Lattice& lattice, const geo::TileKey& key, double tolerance);

}  // namespace terrace::dem

// Where the samples of a tile lie in the source, in pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "engine/dem/crs/footprint.h"
#include "engine/dem/crs/georeference.h"
#include "engine/dem/dem_types.h"
#include "engine/geo/lattice.h"
#include "engine/geo/mercator_grid.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// Of nodes that have no place in a raster: NaN.
inline constexpr Position kNowhere{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

// Pole rows, and what lies beyond them, are one position each; other grids have none.
inline bool IsPoleRow(const geo::Lattice& lattice, std::int64_t row) { return row <= 0 || row >= lattice.rows(); }
template <typename Grid>
bool IsPoleRow(const Grid&, std::int64_t) {
  return false;
}

// The window of a tile: its samples and one more on each side.
NodeWindow WindowOfTile(const geo::Lattice& lattice, const geo::TileKey& key);

// Pixel positions of a window's nodes. A position is a function of the global node alone: whichever window asks gets
// the same bits. Nodes come by rows of the grid, lattices from the south and Mercator from the north, each from the
// west.
//
// Positions are exact for sources in WGS 84 degrees. Others are transformed at 5 x 5 nodes of global cells of 32 x 32
// nodes and interpolated with the fourth degree within `tolerance` pixels; cells where that does not hold are divided.
class NodePositions {
 public:
  NodePositions() = default;  // of no node
  // `x` by column, `y` by row.
  NodePositions(const NodeWindow& window, std::vector<double> x, std::vector<double> y)
      : window_(window), x_(std::move(x)), y_(std::move(y)) {}
  NodePositions(const NodeWindow& window, std::vector<Position> nodes) : window_(window), nodes_(std::move(nodes)) {}
  // Of nodes of a lattice. NaN where the source's CRS has no position, and outside `footprint`. Nodes of a pole row
  // share one position unless columns are meridians.
  // `Grid`: geo::Lattice, or geo::MercatorGrid of pixel centres.
  template <typename Grid>
  static NodePositions Of(const Georeference& georeference, const Footprint& footprint, const Grid& grid,
                          const NodeWindow& window, double tolerance);

  const NodeWindow& window() const { return window_; }
  std::size_t columns() const { return static_cast<std::size_t>(window_.columns); }
  std::size_t rows() const { return static_cast<std::size_t>(window_.rows); }

  // True where meridians are the source's columns and parallels its rows: all nodes of a column have one x, all of a
  // row one y.
  bool is_separable() const { return nodes_.empty(); }
  // One per column and one per row, never NaN. Precondition: is_separable().
  std::span<const double> x() const { return x_; }
  std::span<const double> y() const { return y_; }
  // One per node. Precondition: !is_separable().
  std::span<const Position> nodes() const { return nodes_; }

  Position At(std::size_t i, std::size_t j) const {
    return is_separable() ? Position{x_[i], y_[j]} : nodes_[j * columns() + i];
  }
  // Of a node by its global column and row; kNowhere outside the window.
  Position OfNode(std::int64_t column, std::int64_t row) const {
    const std::int64_t i = column - window_.column, j = row - window_.row;
    if (i < 0 || j < 0 || i >= window_.columns || j >= window_.rows) return kNowhere;
    return At(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  }

 private:
  NodeWindow window_;
  std::vector<double> x_, y_;
  std::vector<Position> nodes_;
};

// Pixel positions of the centres of the tile's cells x cells lattice cells, without a halo: where the pixels of an
// image of the tile are sampled. Row by row from the south-western cell; NaN as in NodePositions.
std::vector<Position> CellCentrePositions(const Georeference& georeference, const Footprint& footprint,
                                          const geo::Lattice& lattice, const geo::TileKey& key, double tolerance);

}  // namespace terrace::dem

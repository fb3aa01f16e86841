// Types shared by the error bounds of a tile (source_error_bound.h): cells, nodes, boxes of pixels.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/geo/lattice.h"

namespace terrace::dem {

inline constexpr double kUnknownError = std::numeric_limits<double>::infinity();

// A half-open box of cells of the tile.
struct CellBox {
  int west = 0, south = 0, east = 0, north = 0;
};

// A cell of the tile at column i and row j. `nodes`: the south-western, south-eastern, north-western and north-eastern
// node.
struct TileCell {
  int i, j;
  std::array<std::size_t, 4> nodes;

  CellBox box() const { return {i, j, i + 1, j + 1}; }
};

// A box in columns and rows of pixels or averages; empty if west > east.
struct PixelBounds {
  double west = std::numeric_limits<double>::infinity(), east = -west, north = west, south = -west;

  void Add(double x, double y) {
    west = std::min(west, x), east = std::max(east, x);
    north = std::min(north, y), south = std::max(south, y);
  }
  void Grow(double x, double y) { west -= x, east += x, north -= y, south += y; }
};

// A box of samples or averages of a raster grid, ends included. If the raster grid wraps, columns may exceed it by one
// turn.
struct SampleBox {
  std::int64_t west = 0, north = 0, east = -1, south = -1;

  bool empty() const { return west > east || north > south; }
  std::int64_t columns() const { return east - west + 1; }
  std::int64_t rows() const { return south - north + 1; }
  // The smallest box that contains both.
  SampleBox Around(const SampleBox& other) const {
    if (empty()) return other;
    if (other.empty()) return *this;
    return {std::min(west, other.west), std::min(north, other.north), std::max(east, other.east),
            std::max(south, other.south)};
  }

  friend bool operator==(const SampleBox&, const SampleBox&) = default;
};

// A tile's served samples with a halo of one. The members must outlive this object.
struct TileNodes {
  const geo::Lattice& lattice;
  const NodeWindow& window;
  std::span<const float> heights;

  int cells() const { return lattice.cells; }
  std::size_t stride() const { return static_cast<std::size_t>(window.columns); }
  // Index of the south-western node of a cell.
  std::size_t NodeIndex(int i, int j) const {
    return static_cast<std::size_t>(j + 1) * stride() + static_cast<std::size_t>(i + 1);
  }
  TileCell Cell(int i, int j) const {
    const std::size_t n = NodeIndex(i, j);
    return {i, j, {n, n + 1, n + stride(), n + stride() + 1}};
  }

  // Global column and row of a cell's node, 0 to 3.
  std::pair<std::int64_t, std::int64_t> GlobalNode(const TileCell& cell, std::size_t k) const {
    return {window.column + 1 + cell.i + (k % 2 == 0 ? 0 : 1), window.row + 1 + cell.j + (k < 2 ? 0 : 1)};
  }

  // Degrees.
  double West(const CellBox& box) const { return lattice.Longitude(window.column + 1 + box.west); }
  double South(const CellBox& box) const { return lattice.Latitude(window.row + 1 + box.south); }
  double Width(const CellBox& box) const { return lattice.StepDegrees() * (box.east - box.west); }
  double Height(const CellBox& box) const { return lattice.StepDegrees() * (box.north - box.south); }
};

}  // namespace terrace::dem

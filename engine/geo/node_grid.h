// A grid of nodes that heights are read for: the samples of a lattice, or the pixel centres of a Mercator grid.
#pragma once

#include <cstdint>
#include <variant>

#include "engine/geo/lattice.h"
#include "engine/geo/mercator_grid.h"

namespace terrace::geo {

// Rows count from the south (Lattice) or from the north (MercatorGrid). Members return what those of the grid return.
class NodeGrid {
 public:
  NodeGrid(const Lattice& lattice) : grid_(lattice) {}         // NOLINT(google-explicit-constructor): is one
  NodeGrid(const MercatorGrid& mercator) : grid_(mercator) {}  // NOLINT(google-explicit-constructor): is one

  // One of them is null.
  const Lattice* lattice() const { return std::get_if<Lattice>(&grid_); }
  const MercatorGrid* mercator() const { return std::get_if<MercatorGrid>(&grid_); }

  std::int64_t columns() const { return lattice() ? lattice()->columns() : mercator()->columns(); }
  std::int64_t rows() const { return lattice() ? lattice()->rows() : mercator()->rows(); }
  double StepDegrees() const { return lattice() ? lattice()->StepDegrees() : mercator()->StepDegrees(); }
  double Longitude(std::int64_t column) const {
    return lattice() ? lattice()->Longitude(column) : mercator()->Longitude(column);
  }
  double Latitude(std::int64_t row) const { return lattice() ? lattice()->Latitude(row) : mercator()->Latitude(row); }
  // Whether a row lies on a pole or beyond it: all its nodes share one position. Mercator grids have no such rows.
  bool IsPoleRow(std::int64_t row) const { return lattice() && (row <= 0 || row >= rows()); }

 private:
  std::variant<Lattice, MercatorGrid> grid_;
};

}  // namespace terrace::geo

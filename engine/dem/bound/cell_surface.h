// The surface of one lattice cell, measured at places that are told in a raster's pixels.
#pragma once

#include <array>
#include <cstddef>

#include "engine/dem/crs/projector.h"

namespace terrace::dem {

// The surface that is bilinear between the heights at a cell's nodes: south-western, south-eastern, north-western,
// north-eastern.
class CellSurface {
 public:
  // `corners`: the nodes' places in pixels, known to that slack beside places of samples. `is_separable`: columns are
  // meridians and rows are parallels, evenly spaced.
  CellSurface(const std::array<Position, 4>& corners, bool is_separable, const Position& slack);

  void SetHeight(std::size_t corner, double height) { heights_[corner] = height; }
  // Heights of samples are known to this much less.
  void Widen(double error) { widened_ += error; }

  // How far a sample at a place is from the surface, at most; 0 where the place is outside the cell.
  double Apart(const Position& at, double sample) const;

 private:
  Position origin_, east_, north_, twist_;
  double slack_x_ = 0, slack_y_ = 0;
  std::array<double, 4> heights_{};
  double widened_ = 0;
};

}  // namespace terrace::dem

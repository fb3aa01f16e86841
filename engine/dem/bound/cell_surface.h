// The surface of one lattice cell, evaluated at positions in pixels of a raster.
#pragma once

#include <array>
#include <cstddef>

#include "engine/dem/crs/projector.h"

namespace terrace::dem {

// The bilinear surface through the heights at a cell's nodes, in the order south-west, south-east, north-west,
// north-east.
class CellSurface {
 public:
  // `corners`: positions of the nodes in pixels, with an uncertainty of `slack` against positions of samples.
  // `is_separable`: columns are meridians and rows are parallels, evenly spaced.
  CellSurface(const std::array<Position, 4>& corners, bool is_separable, const Position& slack);

  void SetHeight(std::size_t corner, double height) { heights_[corner] = height; }
  // Adds to the uncertainty of the samples' heights, in metres.
  void Widen(double error) { widened_ += error; }

  // An upper bound of the distance between a sample and the surface; 0 if the position is outside the cell.
  double Apart(const Position& at, double sample) const;

 private:
  Position origin_, east_, north_, twist_;
  double slack_x_ = 0, slack_y_ = 0;
  std::array<double, 4> heights_{};
  double widened_ = 0;
};

}  // namespace terrace::dem

// How far the averages of a raster are from the samples they stand for.
//
// For each averaging factor f = 2, 4, .. the raster is divided into blocks of kBlock x kBlock averages. A block's error
// is at least |G(p) - h(p)| for the centre p of every valid sample in it: h is the sample, G the surface that is
// interpolated between averages (grid_cells.h), with weights renormalized over valid ones.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/common/dem_types.h"

namespace terrace::dem {

// Filled by one thread, then immutable and thread-safe.
class AveragingErrors {
 public:
  static constexpr int kBlock = 32;  // averages along a side

  struct Level {
    int columns = 0, rows = 0;  // of blocks
    std::vector<float> errors;
  };

  AveragingErrors() = default;
  AveragingErrors(int width, int height);

  // The smallest power of two for which one average covers the whole raster. Larger factors give the same average.
  int largest_factor() const { return 1 << levels_.size(); }

  // Source pixels along a block's side.
  static int BlockPixels(int factor) { return kBlock * factor; }

  void Raise(int factor, int block_column, int block_row, float error) {
    Level& level = levels_[IndexOf(factor)];
    float& known = level.errors[IndexAt(block_column, block_row, level.columns)];
    if (error > known) known = error;
  }

  // Returns the largest error of the blocks that the box touches; the box is in source pixels and clipped to the
  // raster. 0 for factor 1. Infinite if the box has samples without an average.
  float Largest(int factor, double west, double north, double east, double south) const;

  const Level& level(int factor) const { return levels_[IndexOf(factor)]; }
  std::vector<Level>& levels() { return levels_; }
  const std::vector<Level>& levels() const { return levels_; }

 private:
  std::size_t IndexOf(int factor) const;

  std::vector<Level> levels_;  // of factor 2, 4, ..
};

}  // namespace terrace::dem

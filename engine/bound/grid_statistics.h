// Statistics of a raster grid's members around a tile. Not thread-safe.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {

class GridStatistics {
 public:
  // `grid` and `reading` must outlive this.
  GridStatistics(const RasterGrid& grid, const GridReading& reading);

  // Members visited by all queries so far. For tests: a query visits the members that its box meets.
  std::size_t members_visited() const { return members_visited_; }

  // The largest offset of samples of the rasters around the tile from the raster grid on each axis, in pixels.
  const Position& misplacement() const { return misplacement_; }

  // A range that contains all samples in a box, in pixels. Clips the box to the raster grid.
  BlockRange Ranges(double west, double north, double east, double south) const;

  // The largest distance of samples from the surface between averages of the reading's factor (averaging_errors.h). The
  // box is in averages, ends included. Infinite where several rasters contribute to that surface.
  float AveragingError(double west, double north, double east, double south) const;

 private:
  Box BoxAround() const;
  std::vector<std::size_t> MembersAround() const;
  bool IsAround(const Box& pixels) const;
  // Calls visit(member, statistics) for all members that meet a box, and perhaps others. Null statistics: not in
  // memory.
  template <typename Visit>
  void ForMembersAt(const Box& pixels, const Visit& visit) const;
  float ErrorOfAverages(double west, double north, double east, double south) const;  // of pixels

  const RasterGrid& grid_;
  const GridReading& reading_;
  const double turn_;              // columns in 360 degrees; 0: the raster grid is not geographic
  Box around_;                     // the tile's pixels, and some more
  std::vector<std::size_t> near_;  // members that meet it, in any turn
  mutable std::size_t members_visited_ = 0;
  std::vector<StatisticsPtr> statistics_;  // of near_, if they are few; else empty
  Position misplacement_{0, 0};
};

}  // namespace terrace::dem

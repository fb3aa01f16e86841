// What the tables of a raster grid's rasters tell of the pixels around a tile. For one thread.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/dem/mosaic/raster_grid.h"

namespace terrace::dem {

class GridTables {
 public:
  // What `raster grid` and `trace` refer to outlives it. `stride`: nodes in a row of the trace.
  GridTables(const RasterGrid& grid, const GridTrace& trace, std::size_t stride);

  // Of all of the raster grid.
  const HeightRange& heights() const { return grid_.heights(); }

  // So far, for all that was asked. A box is to cost what it meets, not what the raster grid holds.
  std::size_t members_visited() const { return members_visited_; }

  // Pixels by which samples of the rasters around the tile lie off the raster grid's, the most on each axis.
  const Position& misplacement() const { return misplacement_; }

  // At least the range of pixels in a box, clipped to the raster grid.
  BlockRange Ranges(double west, double north, double east, double south) const;

  // How far samples are from the surface between averages of the trace's factor (averaging_errors.h), in a box of them
  // by column and row, ends included. Infinite where that surface is not one raster's own.
  float AveragingError(double west, double north, double east, double south) const;

 private:
  Box BoxAround(std::size_t stride) const;
  std::vector<std::size_t> MembersAround() const;
  bool IsAround(const Box& pixels) const;
  // Calls visit(member, its tables) for at least the members that meet a box. Null tables: they are not at hand.
  template <typename Visit>
  void ForMembersAt(const Box& pixels, const Visit& visit) const;
  float ErrorOfAverages(double west, double north, double east, double south) const;  // of pixels

  const RasterGrid& grid_;
  const GridTrace& trace_;
  const double turn_;              // columns; 0: the raster grid's grid is not one around the Earth
  Box around_;                     // the tile's pixels, and some more
  std::vector<std::size_t> near_;  // members that meet it, in any turn
  mutable std::size_t members_visited_ = 0;
  std::vector<StatisticsPages::Tables> tables_;  // of near_, where they are few; else empty
  Position misplacement_{0, 0};
};

}  // namespace terrace::dem

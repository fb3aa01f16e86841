// What the tables of a sheet's rasters tell of the pixels around a tile.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/dem/sheet.h"

namespace terrace::dem {

class SheetTables {
 public:
  // What `sheet` and `trace` refer to outlives it.
  SheetTables(const Sheet& sheet, const SheetTrace& trace);

  // Of all of the sheet.
  const HeightRange& heights() const { return heights_; }

  // Pixels by which samples of the rasters around the tile lie off the sheet's, the most on each axis.
  const Position& misplacement() const { return misplacement_; }

  // At least the range of pixels in a box, clipped to the sheet.
  BlockRange Ranges(double west, double north, double east, double south) const;

  // How far samples are from the surface between averages of the trace's factor (averaging_errors.h), in a box of them
  // by column and row, ends included. Infinite where that surface is not one raster's own.
  float AveragingError(double west, double north, double east, double south) const;

 private:
  std::vector<std::size_t> MembersAround() const;
  float ErrorOfAverages(double west, double north, double east, double south) const;  // of pixels

  const Sheet& sheet_;
  const SheetTrace& trace_;
  std::vector<std::size_t> near_;  // members around the tile
  HeightRange heights_;
  Position misplacement_{0, 0};
};

}  // namespace terrace::dem

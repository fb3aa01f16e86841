// The set of pixels that the rasters of a raster grid cover.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/crs/node_positions.h"
#include "engine/mosaic/grid_members.h"
#include "engine/raster/raster_layout.h"

namespace terrace::dem {

// Converts a range of pixels to a box, ends included.
Box BoxOf(const PixelRange& pixels);

// Immutable and thread-safe. Positions within 10^-6 pixels of a raster count as inside it.
class GridCover {
 public:
  GridCover() = default;
  // `turn`: columns around the Earth if the raster grid wraps, else 0.
  GridCover(const std::vector<GridMember>& members, std::int64_t turn);

  static constexpr double kEdgeTolerance = 1e-6;  // pixels

  // One entry per node, row by row: 1 where its position lies inside a raster, else 0.
  std::vector<std::uint8_t> Inside(const NodePositions& positions) const;
  // The same for single positions.
  std::vector<std::uint8_t> Inside(std::span<const Position> positions) const;

  // Whether the rasters cover all of these pixels. Precondition: the range is not empty and lies inside the raster
  // grid.
  bool Covers(const PixelRange& pixels) const;

  // Makes the heights of blocks of `factor` x `factor` pixels void where no raster has a part of the block.
  // `blocks_of_turn`: blocks around the Earth if the raster grid wraps, else 0.
  void RemoveUncovered(int factor, std::int64_t blocks_of_turn, const GridWindow& window,
                       std::vector<float>& heights) const;

 private:
  std::vector<std::uint8_t> Inside(std::span<const Position> positions, const PositionExtent& known) const;
  std::vector<std::uint8_t> InsideOfAxes(const NodePositions& positions) const;

  std::vector<PixelRange> boxes_;  // without overlap
  BoxIndex index_;
};

}  // namespace terrace::dem

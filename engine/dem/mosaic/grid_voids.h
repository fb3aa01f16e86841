// Which voids of a raster grid are holes, with data all around them, and which are collars: those that touch a place
// where the raster grid has no raster. A void that several rasters share is one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/dem/common/box_index.h"
#include "engine/dem/mosaic/grid_members.h"

namespace terrace::dem {

// Immutable and thread-safe. By default there are no holes.
class GridVoids {
 public:
  GridVoids() = default;
  // `index`: of the members, by pixels. `turn`: columns after which the raster grid repeats itself; 0: it does not.
  GridVoids(const std::vector<GridMember>& members, const BoxIndex& index, std::int64_t turn);

  // For each void of a window of averages, row by row: 1 if it is part of a hole; of others 0. `columns`: of the
  // raster grid's averages. `members` and `index` as above.
  std::vector<std::uint8_t> HolesIn(const std::vector<GridMember>& members, const BoxIndex& index, int factor,
                                    const GridWindow& window, std::int64_t columns,
                                    std::span<const float> heights) const;

  // Whether a hole that several members share may reach into a box of pixels; RangeTable knows of all others.
  bool SharesHole(const Box& pixels) const;

  // How often the constructor looked at voids of a member: as often as something changes along the rims of members.
  std::size_t looks() const { return looks_; }

 private:
  bool IsHole(const GridMember& member, std::size_t index, std::int64_t column, std::int64_t row) const;

  std::int64_t turn_ = 0;
  std::size_t looks_ = 0;
  std::vector<std::vector<std::uint8_t>> closed_;  // by member and region of its RimVoids: part of a hole
  std::vector<geo::TileRange> shared_;             // pixels around those
};

}  // namespace terrace::dem

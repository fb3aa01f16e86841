// Divides the voids of a raster grid that are too wide to be filled from their edges into holes, with data all around
// them, and collars, which touch a place without a raster. A void that extends over several rasters is one void.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/mosaic/grid_members.h"

namespace terrace::dem {

// Immutable and thread-safe. A default-constructed object has no holes.
class GridVoids {
 public:
  GridVoids() = default;
  // `index`: the members' boxes in pixels. `turn`: number of columns after which the raster grid repeats itself; 0: it
  // does not.
  GridVoids(const std::vector<GridMember>& members, const BoxIndex& index, std::int64_t turn);

  // Returns, for each average of a window, row by row, 1 if it is a void in a hole, else 0. `columns`: the number of
  // columns of the raster grid's averages. `members` and `index` as above.
  std::vector<std::uint8_t> HolesIn(const std::vector<GridMember>& members, const BoxIndex& index, int factor,
                                    const GridWindow& window, std::int64_t columns,
                                    std::span<const float> heights) const;

  // Whether a hole that extends over several members may intersect a box of pixels. RangeTable knows all other holes.
  bool SharesHole(const Box& pixels) const;

  // By region of the member's RimVoids: 1 if it is part of a hole. Empty: the member has no holes.
  std::span<const std::uint8_t> HoleRegions(std::size_t member) const {
    return member < hole_regions_.size() ? std::span<const std::uint8_t>(hole_regions_[member])
                                         : std::span<const std::uint8_t>();
  }

  // How often the constructor examined voids of a member: once for each change along the rims of members. For tests.
  std::size_t examinations() const { return examinations_; }

 private:
  // Sets `last_column` to the last column of the row for which the result is the same.
  bool IsHole(const GridMember& member, std::size_t index, std::int64_t column, std::int64_t row,
              std::int64_t& last_column) const;

  std::int64_t turn_ = 0;
  std::size_t examinations_ = 0;
  std::vector<std::vector<std::uint8_t>> hole_regions_;  // by member and region of its RimVoids: 1 if part of a hole
  std::vector<PixelRange> shared_;                       // boxes of pixels around them
};

}  // namespace terrace::dem

#include "engine/mosaic/grid_voids.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "engine/geo/tile_cover.h"

namespace terrace::dem {
namespace {

// A member, moved by whole turns.
struct Placed {
  const GridMember* member;
  std::size_t index;
  std::int64_t column;  // of its first pixel

  bool Has(std::int64_t x, std::int64_t y) const {
    const RasterLayout& layout = member->raster->layout();
    return x >= column && x < column + layout.columns && y >= member->row && y < member->row + layout.height;
  }
  // Sets `same` to the number of pixels along the row or the column for which the result is the same. Precondition:
  // Has(x, y).
  std::optional<std::uint32_t> RegionAt(std::int64_t x, std::int64_t y, bool along_row, std::int64_t& same) const {
    const RasterLayout& layout = member->raster->layout();
    const std::int64_t own_x = x - column, own_y = y - member->row;
    const RimVoids::Stretch stretch = member->raster->rim_voids().StretchAt(own_x, own_y);
    same = along_row ? std::min<std::int64_t>(stretch.last_column, layout.columns - 1) - own_x + 1
                     : std::min<std::int64_t>(stretch.last_row, layout.height - 1) - own_y + 1;
    return stretch.region;
  }
  // The number of pixels from (x, y) on, along the row or the column, before the member begins; the maximum if it does
  // not.
  std::int64_t Before(std::int64_t x, std::int64_t y, bool along_row) const {
    const std::int64_t before = along_row ? column - x : member->row - y;
    return before > 0 ? before : std::numeric_limits<std::int64_t>::max();
  }
};

// Members that intersect a box of pixels, in order.
std::vector<Placed> PlacedIn(const std::vector<GridMember>& members, const BoxIndex& index, std::int64_t turn,
                             const PixelRange& box) {
  std::vector<Placed> placed;
  const Box pixels{static_cast<double>(box.start_x), static_cast<double>(box.start_y), static_cast<double>(box.end_x),
                   static_cast<double>(box.end_y)};
  for (const std::size_t i : index.Find(pixels)) {
    for (const std::int64_t shift : {std::int64_t{0}, -turn, turn}) {
      PixelRange at = members[i].pixels();
      at.start_x += shift, at.end_x += shift;
      if (!geo::IsEmpty(geo::Intersection(at, box))) placed.push_back({&members[i], i, members[i].column + shift});
      if (turn == 0) break;
    }
  }
  return placed;
}

// Joins adjacent regions of members, and marks those that touch a place without a raster.
class Joints {
 public:
  Joints(const std::vector<GridMember>& members, const BoxIndex& index, std::int64_t turn)
      : members_(members), index_(index), turn_(turn) {
    std::size_t count = 0;
    for (const GridMember& member : members) {
      first_.push_back(count);
      count += member.raster->rim_voids().regions();
    }
    parents_.resize(count);
    std::iota(parents_.begin(), parents_.end(), 0);
    is_open_.resize(count);
  }

  void Add(std::size_t i) {
    const GridMember& member = members_[i];
    const RimVoids& voids = member.raster->rim_voids();
    if (voids.is_everything()) is_open_[RootOf(first_[i])] = 1;
    if (!voids.has_runs()) return;
    const RasterLayout& layout = member.raster->layout();
    const std::int64_t last_x = member.column + layout.columns - 1, last_y = member.row + layout.height - 1;
    around_ = PlacedIn(members_, index_, turn_, {member.column - 1, member.row - 1, last_x + 1, last_y + 1});
    std::erase_if(around_, [&](const Placed& p) { return p.index == i && p.column == member.column; });
    const Placed self{&member, i, member.column};
    for (const std::int64_t dy : {-1, 1}) {
      const std::int64_t y = dy < 0 ? member.row : last_y;
      for (std::int64_t x = member.column; x <= last_x;) x += Touch(self, x, y, 0, dy);
    }
    for (const std::int64_t dx : {-1, 1}) {
      const std::int64_t x = dx < 0 ? member.column : last_x;
      for (std::int64_t y = member.row; y <= last_y;) y += Touch(self, x, y, dx, 0);
    }
  }

  std::size_t examinations() const { return examinations_; }

  bool IsHole(std::size_t member, std::uint32_t region) { return is_open_[RootOf(first_[member] + region)] == 0; }

 private:
  // Examines the pixel (x, y) of a member's rim and the pixel (x + dx, y + dy) beyond it. Returns the number of pixels
  // along the rim, to the east or south, for which the result is the same: rims have many more pixels than changes.
  std::int64_t Touch(const Placed& self, std::int64_t x, std::int64_t y, std::int64_t dx, std::int64_t dy) {
    const bool is_row = dx == 0;
    std::int64_t same = 0;
    const auto own = self.RegionAt(x, y, is_row, same);
    ++examinations_;
    if (!own) return same;
    const std::size_t region = first_[self.index] + *own;
    // Another member may have a sample or a hole there: then the raster grid's void does not continue.
    bool goes_on = true, is_covered = false;
    const auto meet = [&](std::int64_t column, std::int64_t row) {
      for (const Placed& other : around_) {
        std::int64_t there = other.Before(column, row, is_row);
        if (other.Has(column, row)) {
          ++examinations_;
          is_covered = true;
          const auto met = other.RegionAt(column, row, is_row, there);
          if (met) {
            Join(region, first_[other.index] + *met);
          } else {
            goes_on = false;
          }
        }
        same = std::min(same, there);
      }
    };
    meet(x, y);
    if (!goes_on) return same;
    is_covered = false;
    meet(x + dx, y + dy);
    if (!is_covered) is_open_[RootOf(region)] = 1;
    return same;
  }

  std::size_t RootOf(std::size_t region) {
    while (parents_[region] != region) {
      parents_[region] = parents_[parents_[region]];
      region = parents_[region];
    }
    return region;
  }
  void Join(std::size_t a, std::size_t b) {
    a = RootOf(a), b = RootOf(b);
    if (a == b) return;
    parents_[b] = a;
    is_open_[a] |= is_open_[b];
  }

  const std::vector<GridMember>& members_;
  const BoxIndex& index_;
  const std::int64_t turn_;
  std::vector<std::size_t> first_;    // region of each member
  std::vector<std::size_t> parents_;  // of regions, up to their roots
  std::vector<std::uint8_t> is_open_;
  std::vector<Placed> around_;    // the current member
  std::size_t examinations_ = 0;  // number of look-ups of voids
};

}  // namespace

GridVoids::GridVoids(const std::vector<GridMember>& members, const BoxIndex& index, std::int64_t turn)
    : turn_(turn), hole_regions_(members.size()) {
  // A single raster's regions are sufficient, unless its first column is adjacent to the last.
  Joints joints(members, index, turn);
  for (std::size_t i = 0; i < members.size(); ++i) joints.Add(i);
  examinations_ = joints.examinations();
  for (std::size_t i = 0; i < members.size(); ++i) {
    const RimVoids& voids = members[i].raster->rim_voids();
    for (std::uint32_t region = 0; region < voids.regions(); ++region) {
      hole_regions_[i].push_back(joints.IsHole(i, region) ? 1 : 0);
    }
    if (std::ranges::none_of(hole_regions_[i], [](std::uint8_t is_hole) { return is_hole != 0; })) continue;
    PixelRange around{1, 1, 0, 0};
    for (const RimVoids::Run& run : voids.Runs()) {
      if (hole_regions_[i][run.region] == 0) continue;
      const std::int64_t x = members[i].column, y = members[i].row + run.row;
      const PixelRange pixels{x + run.first, y, x + run.last, y};
      around = geo::IsEmpty(around) ? pixels : geo::BoundingRange(around, pixels);
    }
    shared_.push_back(around);
  }
}

bool GridVoids::IsHole(const GridMember& member, std::size_t index, std::int64_t column, std::int64_t row,
                       std::int64_t& last_column) const {
  const RimVoids::Stretch stretch = member.raster->rim_voids().StretchAt(column, row);
  last_column = stretch.last_column;
  return !stretch.region || hole_regions_[index][*stretch.region] != 0;
}

std::vector<std::uint8_t> GridVoids::HolesIn(const std::vector<GridMember>& members, const BoxIndex& index, int factor,
                                             const GridWindow& window, std::int64_t columns,
                                             std::span<const float> heights) const {
  // A void average covers only voids, which are connected: the first one decides for all.
  std::vector<std::uint8_t> holes(heights.size());
  const std::vector<Placed> all =
      PlacedIn(members, index, turn_,
               {window.column * factor, window.row * factor, (window.column + window.columns) * factor,
                (window.row + window.rows) * factor});
  constexpr std::size_t kFew = 16;
  // What was found last in a member's row: runs are much longer than a pixel.
  struct Found {
    bool is_hole = false;
    std::int64_t first_column = 0, last_column = -1;
  };
  std::vector<Found> found(all.size());
  std::size_t i = 0;
  for (std::int64_t row = window.row; row < window.row + window.rows; ++row) {
    std::ranges::fill(found, Found{});
    for (std::int64_t column = window.column; column < window.column + window.columns; ++column, ++i) {
      if (!std::isnan(heights[i])) continue;
      const std::int64_t canonical = turn_ > 0 ? FloorMod(column, columns) : column;
      const std::int64_t x = canonical * factor, y = row * factor;
      const auto is_hole = [&](const Placed& p, Found& known) {
        if (!p.Has(x, y)) return false;
        const std::int64_t at = x - p.column;
        if (at < known.first_column || at > known.last_column) {
          known.first_column = at;
          known.is_hole = IsHole(*p.member, p.index, at, y - p.member->row, known.last_column);
        }
        return known.is_hole;
      };
      // If several members have the pixel, one hole is enough.
      if (all.size() <= kFew && canonical == column) {
        for (std::size_t k = 0; k < all.size() && holes[i] == 0; ++k) holes[i] = is_hole(all[k], found[k]) ? 1 : 0;
        continue;
      }
      for (const Placed& p : PlacedIn(members, index, turn_, {x, y, x, y})) {
        Found unknown;
        if (is_hole(p, unknown)) holes[i] = 1;
      }
    }
  }
  return holes;
}

bool GridVoids::SharesHole(const Box& pixels) const {
  return std::ranges::any_of(shared_, [&](const PixelRange& range) {
    const auto meets = [&](double shift) {
      return pixels.max_x + shift >= static_cast<double>(range.start_x) &&
             pixels.min_x + shift <= static_cast<double>(range.end_x + 1) &&
             pixels.max_y >= static_cast<double>(range.start_y) && pixels.min_y <= static_cast<double>(range.end_y + 1);
    };
    const auto turn = static_cast<double>(turn_);
    return meets(0) || (turn_ > 0 && (meets(turn) || meets(-turn)));
  });
}

}  // namespace terrace::dem

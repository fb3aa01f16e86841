#include "engine/mosaic/grid_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/crs/georeference.h"
#include "engine/crs/vertical_datum.h"
#include "engine/geo/tile_cover.h"
#include "engine/mosaic/grid_members.h"

namespace terrace::dem {
namespace {

// Buckets per axis. Offsets that OffsetOf treats as equal differ by less than a bucket, so they lie in the same or in
// adjacent buckets.
constexpr int kBuckets = 64;
static_assert(Georeference::kOffsetTolerance < 0.9 / kBuckets);

std::array<double, 4> PixelOf(const Georeference& where) {
  const std::array<double, 6>& affine = where.to_crs();
  return {affine[1], affine[2], affine[4], affine[5]};
}

struct Bucket {
  int x = 0, y = 0;

  std::uint32_t key() const {
    const auto wrapped = [](int index) { return static_cast<std::uint32_t>((index + kBuckets) % kBuckets); };
    return wrapped(x) * kBuckets + wrapped(y);
  }
};

// Returns nothing if the raster is so far away that the fraction of a pixel is lost.
std::optional<Bucket> BucketOf(const Georeference& first, const Georeference& where) {
  const Position offset = first.CornerOf(where);
  if (!(std::max(std::abs(offset.x), std::abs(offset.y)) < Georeference::kFarthestPixel)) return std::nullopt;
  const auto index = [](double pixels) {
    return std::min(static_cast<int>((pixels - std::floor(pixels)) * kBuckets), kBuckets - 1);
  };
  return Bucket{index(offset.x), index(offset.y)};
}

// Finds rasters that lie on one pixel grid, by reference system, vertical datum, pixel size and offset.
// Offsets within a tolerance count as whole pixels (Georeference::OffsetOf), so a raster may fit several grids. It then
// belongs to the first of them, in the order in which grids were added. A look-up takes constant time if pixel sizes
// are bit-equal; else its time grows with the number of different pixel sizes.
class GridFinder {
 public:
  struct Membership {
    std::size_t grid = 0;  // grids are numbered from 0; the next number is a new grid
    PixelOffset offset;    // of the raster's first pixel from that of the grid's first raster
  };

  // Returns the raster's grid. A raster that fits no grid begins a new one.
  Membership Add(const PlacedRaster& raster);

  // Grids that rasters were compared with so far. For tests: this grows linearly with the number of rasters.
  std::size_t grids_compared() const { return grids_compared_; }

 private:
  // Bucket of an offset's fraction of a pixel.
  using Phase = std::uint32_t;

  // Grids whose pixels are bit-equal except for the offset. Their numbers are ascending.
  struct Family {
    const Georeference* first = nullptr;
    std::vector<std::size_t> grids;
    std::unordered_map<Phase, std::vector<std::size_t>> by_phase;
    std::vector<std::size_t> far;  // too far away for a phase
  };
  // Families with the same reference system and vertical datum, in the order in which they were added.
  struct Kind {
    const VerticalDatum* vertical = nullptr;
    std::vector<Family> families;
    std::map<std::array<double, 4>, std::size_t> by_pixel;
  };

  Kind& KindOf(const PlacedRaster& raster);
  std::vector<std::size_t> Candidates(const Family& family, const Georeference& where) const;
  void Keep(Kind& kind, const Georeference& where, std::size_t grid);

  std::vector<const Georeference*> grids_;                         // their first rasters
  std::unordered_map<std::string_view, std::vector<Kind>> kinds_;  // by the reference system
  std::size_t grids_compared_ = 0;
};

GridFinder::Kind& GridFinder::KindOf(const PlacedRaster& raster) {
  std::vector<Kind>& kinds = kinds_[raster.where->horizontal_wkt()];
  const auto known =
      std::ranges::find_if(kinds, [&](const Kind& kind) { return kind.vertical->IsSame(*raster.vertical); });
  if (known != kinds.end()) return *known;
  return kinds.emplace_back(Kind{raster.vertical, {}, {}});
}

// Includes all grids of the family that the raster fits.
std::vector<std::size_t> GridFinder::Candidates(const Family& family, const Georeference& where) const {
  const auto bucket = BucketOf(*family.first, where);
  if (!bucket) return family.grids;
  std::vector<std::size_t> grids = family.far;
  for (int x = bucket->x - 1; x <= bucket->x + 1; ++x) {
    for (int y = bucket->y - 1; y <= bucket->y + 1; ++y) {
      const auto found = family.by_phase.find(Bucket{x, y}.key());
      if (found != family.by_phase.end()) grids.insert(grids.end(), found->second.begin(), found->second.end());
    }
  }
  std::ranges::sort(grids);
  return grids;
}

GridFinder::Membership GridFinder::Add(const PlacedRaster& raster) {
  const Georeference& where = *raster.where;
  Kind& kind = KindOf(raster);
  std::optional<Membership> first;
  for (const Family& family : kind.families) {
    // Families are in the order of their first grids.
    if (first && family.grids.front() > first->grid) break;
    if (!family.first->MayAlign(where)) continue;
    for (const std::size_t grid : Candidates(family, where)) {
      if (first && grid > first->grid) break;
      ++grids_compared_;
      if (const auto offset = grids_[grid]->OffsetOf(where)) {
        first = Membership{grid, *offset};
        break;
      }
    }
  }
  if (first) return *first;
  Keep(kind, where, grids_.size());
  grids_.push_back(&where);
  return {grids_.size() - 1, {}};
}

void GridFinder::Keep(Kind& kind, const Georeference& where, std::size_t grid) {
  const auto [known, is_new] = kind.by_pixel.try_emplace(PixelOf(where), kind.families.size());
  if (is_new) kind.families.push_back(Family{&where, {}, {}, {}});
  Family& family = kind.families[known->second];
  family.grids.push_back(grid);
  const auto bucket = BucketOf(*family.first, where);
  (bucket ? family.by_phase[bucket->key()] : family.far).push_back(grid);
}

// A raster's position on its grid, relative to the first pixel of the grid's first raster.
struct Member {
  std::size_t raster = 0;
  const Georeference* where = nullptr;
  std::int64_t column = 0, row = 0;

  PixelRange pixels() const { return {column, row, column + where->width() - 1, row + where->height() - 1}; }
};

std::vector<std::vector<Member>> GridsOf(std::span<const PlacedRaster> rasters, std::size_t& pairs) {
  std::vector<std::vector<Member>> grids;
  GridFinder finder;
  for (std::size_t i = 0; i < rasters.size(); ++i) {
    const GridFinder::Membership place = finder.Add(rasters[i]);
    if (place.grid == grids.size()) grids.emplace_back();
    grids[place.grid].push_back({i, rasters[i].where, place.offset.column, place.offset.row});
  }
  pairs += finder.grids_compared();
  return grids;
}

// The number of columns after which a grid repeats itself; 0: it does not.
std::int64_t TurnOf(const Georeference& where) {
  const double whole = std::round(where.period());
  return where.period() > 0 && std::abs(where.period() - whole) < 0.01 ? static_cast<std::int64_t>(whole) : 0;
}

bool Touch(const PixelRange& a, const PixelRange& b) {
  return !geo::IsEmpty(geo::Intersection({a.start_x - 1, a.start_y - 1, a.end_x + 1, a.end_y + 1}, b));
}

// Returns the member's column, moved by whole turns, at which it touches `pixels`; nothing if there is none.
std::optional<std::int64_t> ColumnBeside(const PixelRange& pixels, Member member, std::int64_t turn) {
  const std::int64_t canonical = member.column;
  const auto nearest =
      turn == 0 ? 0 : std::llround(static_cast<double>(pixels.start_x - canonical) / static_cast<double>(turn));
  for (const std::int64_t more : {0, -1, 1}) {
    member.column = canonical + (nearest + more) * turn;
    if (Touch(pixels, member.pixels())) return member.column;
    if (turn == 0) break;
  }
  return std::nullopt;
}

// An index of the grid's members without a group, by their pixels.
class Ungrouped {
 public:
  Ungrouped(const std::vector<Member>& members, std::int64_t turn) : turn_(turn), index_(EntriesOf(members)) {}

  // Returns all members that touch `pixels`, and perhaps others, ascending. The grid may repeat itself.
  std::vector<std::size_t> Near(const PixelRange& pixels) const {
    return index_.Find(BoxOf(Canonical({pixels.start_x - 1, pixels.start_y - 1, pixels.end_x + 1, pixels.end_y + 1})));
  }

  // State at the time when the index was made.
  void Remove(const Member& member, std::size_t number) {
    for (const BoxIndex::Entry& entry : EntriesOf(member, number)) index_.Remove(entry);
  }

 private:
  static Box BoxOf(const PixelRange& pixels) {
    const auto at = [](std::int64_t pixel) { return static_cast<double>(pixel); };
    return {at(pixels.start_x), at(pixels.start_y), at(pixels.end_x), at(pixels.end_y)};
  }

  // Within the first turn; all columns for a grid that spans the whole Earth or nearly so.
  PixelRange Canonical(PixelRange pixels) const {
    if (turn_ == 0) return pixels;
    const std::int64_t columns = pixels.end_x - pixels.start_x;
    pixels.start_x = columns + 2 >= turn_ ? -2 * turn_ : FloorMod(pixels.start_x, turn_);
    pixels.end_x = columns + 2 >= turn_ ? 4 * turn_ : pixels.start_x + columns;
    return pixels;
  }

  std::vector<BoxIndex::Entry> EntriesOf(const Member& member, std::size_t number) const {
    std::vector<BoxIndex::Entry> entries;
    const PixelRange pixels = Canonical(member.pixels());
    for (const std::int64_t turns : {0, -1, 1}) {
      entries.push_back(
          {BoxOf({pixels.start_x + turns * turn_, pixels.start_y, pixels.end_x + turns * turn_, pixels.end_y}),
           number});
      if (turn_ == 0) break;
    }
    return entries;
  }
  std::vector<BoxIndex::Entry> EntriesOf(const std::vector<Member>& members) const {
    std::vector<BoxIndex::Entry> all;
    for (std::size_t i = 0; i < members.size(); ++i)
      std::ranges::copy(EntriesOf(members[i], i), std::back_inserter(all));
    return all;
  }

  const std::int64_t turn_;
  BoxIndex index_;
};

// Returns groups of members that touch. Moves the columns of members by whole turns, so that they are adjacent to those
// that they touch.
std::vector<std::vector<std::size_t>> GroupsOf(std::vector<Member>& members, std::int64_t turn, std::size_t& pairs) {
  std::vector<std::vector<std::size_t>> groups;
  std::vector<bool> taken(members.size());
  Ungrouped ungrouped(members, turn);
  for (std::size_t first = 0; first < members.size(); ++first) {
    if (taken[first]) continue;
    taken[first] = true;
    ungrouped.Remove(members[first], first);
    std::vector<std::size_t>& group = groups.emplace_back(std::vector{first});
    for (std::size_t done = 0; done < group.size(); ++done) {
      const PixelRange pixels = members[group[done]].pixels();
      for (const std::size_t i : ungrouped.Near(pixels)) {
        ++pairs;
        const auto column = ColumnBeside(pixels, members[i], turn);
        if (!column) continue;
        ungrouped.Remove(members[i], i);
        members[i].column = *column;
        taken[i] = true;
        group.push_back(i);
      }
    }
    std::ranges::sort(group);
  }
  return groups;
}

// Moves the origin of pixels to the north-western corner of all; for a group around the whole Earth, to the westernmost
// raster.
GridLayout LayoutOf(const std::vector<Member>& members, std::int64_t turn) {
  PixelRange hull = members.front().pixels();
  for (const Member& member : members) hull = geo::BoundingRange(hull, member.pixels());
  const bool around = turn > 0 && hull.end_x - hull.start_x + 1 >= turn && members.size() > 1;
  if (around) {
    const auto west = [](const Member& member) {
      Position corner{0, 0};
      member.where->ToDegrees({&corner, 1});
      return corner.x;
    };
    hull.start_x = std::ranges::min_element(members, {}, west)->column;
    hull.end_x = hull.start_x + turn - 1;
  }
  GridLayout layout{
      {}, static_cast<int>(hull.end_x - hull.start_x + 1), static_cast<int>(hull.end_y - hull.start_y + 1)};
  for (const Member& member : members) {
    const std::int64_t column = member.column - hull.start_x;
    layout.members.push_back({member.raster, around ? FloorMod(column, turn) : column, member.row - hull.start_y});
  }
  return layout;
}

}  // namespace

std::vector<GridLayout> LayOutGrids(std::span<const PlacedRaster> rasters, std::size_t* pairs) {
  std::vector<GridLayout> layouts;
  std::size_t compared = 0;
  for (std::vector<Member>& grid : GridsOf(rasters, compared)) {
    const std::int64_t turn = TurnOf(*grid.front().where);
    for (const std::vector<std::size_t>& group : GroupsOf(grid, turn, compared)) {
      std::vector<Member> members;
      for (const std::size_t i : group) members.push_back(grid[i]);
      layouts.push_back(LayoutOf(members, turn));
    }
  }
  std::ranges::sort(layouts, {}, [](const GridLayout& layout) { return layout.members.front().raster; });
  if (pairs != nullptr) *pairs = compared;
  return layouts;
}

std::vector<GridPlan> PlanGrids(const std::vector<std::shared_ptr<const RasterSource>>& rasters) {
  std::vector<PlacedRaster> placed;
  for (const auto& raster : rasters) placed.push_back({&raster->georeference(), &raster->vertical()});
  std::vector<GridPlan> plans;
  for (const GridLayout& layout : LayOutGrids(placed)) {
    GridPlan& plan = plans.emplace_back(GridPlan{{}, layout.width, layout.height});
    for (const LaidRaster& member : layout.members) {
      plan.members.push_back({rasters[member.raster], member.column, member.row});
    }
  }
  return plans;
}

}  // namespace terrace::dem

#include "engine/dem/mosaic/grid_layout.h"

#include <algorithm>
#include <boost/geometry/algorithms/covered_by.hpp>
#include <boost/geometry/algorithms/equals.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point.hpp>
#include <boost/geometry/index/rtree.hpp>
#include <boost/geometry/strategies/index/cartesian.hpp>
#include <boost/geometry/strategies/relate/cartesian.hpp>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "engine/geo/tile_cover.h"

namespace terrace::dem {
namespace {

// A raster's position on its grid, relative to the first pixel of the grid's first raster.
struct Member {
  std::size_t raster = 0;
  const Georeference* where = nullptr;
  std::int64_t column = 0, row = 0;

  geo::TileRange pixels() const { return {column, row, column + where->width() - 1, row + where->height() - 1}; }
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

bool Touch(const geo::TileRange& a, const geo::TileRange& b) {
  return !geo::IsEmpty(geo::Common({a.start_x - 1, a.start_y - 1, a.end_x + 1, a.end_y + 1}, b));
}

// Returns the member's column, moved by whole turns, at which it touches `pixels`; nothing if there is none.
std::optional<std::int64_t> ColumnBeside(const geo::TileRange& pixels, Member member, std::int64_t turn) {
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

std::int64_t FloorMod(std::int64_t value, std::int64_t modulus) { return (value % modulus + modulus) % modulus; }

// An index of the grid's members without a group, by their pixels.
class Ungrouped {
 public:
  Ungrouped(const std::vector<Member>& members, std::int64_t turn) : turn_(turn), tree_(EntriesOf(members)) {}

  // Returns all members that touch `pixels`, and perhaps others, ascending. The grid may repeat itself.
  std::vector<std::size_t> Near(const geo::TileRange& pixels) const {
    std::vector<std::size_t> found;
    const geo::TileRange wide = Canonical({pixels.start_x - 1, pixels.start_y - 1, pixels.end_x + 1, pixels.end_y + 1});
    for (auto it = tree_.qbegin(boost::geometry::index::intersects(BoxOf(wide))); it != tree_.qend(); ++it) {
      found.push_back(it->second);
    }
    std::ranges::sort(found);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  // State at the time when the index was made.
  void Remove(const Member& member, std::size_t number) {
    for (const Entry& entry : EntriesOf(member, number)) tree_.remove(entry);
  }

 private:
  using Point = boost::geometry::model::point<double, 2, boost::geometry::cs::cartesian>;
  using Rectangle = boost::geometry::model::box<Point>;
  using Entry = std::pair<Rectangle, std::size_t>;

  static Rectangle BoxOf(const geo::TileRange& pixels) {
    const auto at = [](std::int64_t pixel) { return static_cast<double>(pixel); };
    return {{at(pixels.start_x), at(pixels.start_y)}, {at(pixels.end_x), at(pixels.end_y)}};
  }

  // Within the first turn; all columns for a grid that spans the whole Earth or nearly so.
  geo::TileRange Canonical(geo::TileRange pixels) const {
    if (turn_ == 0) return pixels;
    const std::int64_t columns = pixels.end_x - pixels.start_x;
    pixels.start_x = columns + 2 >= turn_ ? -2 * turn_ : FloorMod(pixels.start_x, turn_);
    pixels.end_x = columns + 2 >= turn_ ? 4 * turn_ : pixels.start_x + columns;
    return pixels;
  }

  std::vector<Entry> EntriesOf(const Member& member, std::size_t number) const {
    std::vector<Entry> entries;
    const geo::TileRange pixels = Canonical(member.pixels());
    for (const std::int64_t turns : {0, -1, 1}) {
      entries.emplace_back(
          BoxOf({pixels.start_x + turns * turn_, pixels.start_y, pixels.end_x + turns * turn_, pixels.end_y}), number);
      if (turn_ == 0) break;
    }
    return entries;
  }
  std::vector<Entry> EntriesOf(const std::vector<Member>& members) const {
    std::vector<Entry> all;
    for (std::size_t i = 0; i < members.size(); ++i)
      std::ranges::copy(EntriesOf(members[i], i), std::back_inserter(all));
    return all;
  }

  const std::int64_t turn_;
  boost::geometry::index::rtree<Entry, boost::geometry::index::quadratic<16>> tree_;
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
      const geo::TileRange pixels = members[group[done]].pixels();
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
  geo::TileRange hull = members.front().pixels();
  for (const Member& member : members) hull = geo::Hull(hull, member.pixels());
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

}  // namespace terrace::dem

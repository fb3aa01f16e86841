#include "engine/dem/sheet_members.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/geo/tile_cover.h"

namespace terrace::dem {
namespace {

// Rasters on one grid, touching or not.
struct Grid {
  const Georeference* first = nullptr;
  std::vector<SheetMember> members;  // counted from the first pixel of the first
  std::vector<std::size_t> order;    // of the members among all rasters
};

std::vector<Grid> GridsOf(const std::vector<std::shared_ptr<const RasterSource>>& rasters) {
  std::vector<Grid> grids;
  for (std::size_t i = 0; i < rasters.size(); ++i) {
    const Georeference& where = rasters[i]->georeference();
    std::optional<PixelOffset> offset;
    const VerticalDatum& vertical = rasters[i]->vertical();
    const auto fits = [&](const Grid& grid) {
      if (!vertical.IsSame(grid.members.front().raster->vertical())) return false;
      offset = grid.first->OffsetOf(where);
      return offset.has_value();
    };
    auto grid = std::ranges::find_if(grids, fits);
    if (grid == grids.end()) {
      offset = PixelOffset{};
      grid = grids.insert(grids.end(), Grid{&where, {}, {}});
    }
    grid->members.push_back({rasters[i], offset->column, offset->row});
    grid->order.push_back(i);
  }
  return grids;
}

// Columns after which a grid repeats itself; 0: it does not.
std::int64_t TurnOf(const Georeference& where) {
  const double whole = std::round(where.period());
  return where.period() > 0 && std::abs(where.period() - whole) < 0.01 ? static_cast<std::int64_t>(whole) : 0;
}

bool Touch(const geo::TileRange& a, const geo::TileRange& b) {
  return !geo::IsEmpty(geo::Common({a.start_x - 1, a.start_y - 1, a.end_x + 1, a.end_y + 1}, b));
}

// The member's column, some turns on, where it touches `pixels`; nothing if it does nowhere.
std::optional<std::int64_t> ColumnBeside(const geo::TileRange& pixels, SheetMember member, std::int64_t turn) {
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

// Counts pixels from the north-western corner of all; from the westernmost raster where they go all around the Earth.
SheetPlan PlanOf(std::vector<SheetMember> members, std::int64_t turn) {
  geo::TileRange hull = members.front().pixels();
  for (const SheetMember& member : members) hull = geo::Hull(hull, member.pixels());
  const bool around = turn > 0 && hull.end_x - hull.start_x + 1 >= turn && members.size() > 1;
  if (around) {
    const auto west = [](const SheetMember& member) {
      Position corner{0, 0};
      member.raster->georeference().ToDegrees({&corner, 1});
      return corner.x;
    };
    hull.start_x = std::ranges::min_element(members, {}, west)->column;
    hull.end_x = hull.start_x + turn - 1;
  }
  for (SheetMember& member : members) {
    member.column -= hull.start_x;
    member.row -= hull.start_y;
    if (around) member.column = (member.column % turn + turn) % turn;
  }
  return {std::move(members), static_cast<int>(hull.end_x - hull.start_x + 1),
          static_cast<int>(hull.end_y - hull.start_y + 1)};
}

}  // namespace

std::vector<SheetPlan> PlanSheets(const std::vector<std::shared_ptr<const RasterSource>>& rasters) {
  std::vector<std::pair<std::size_t, SheetPlan>> plans;  // by the place of the first member
  for (Grid& grid : GridsOf(rasters)) {
    const std::int64_t turn = TurnOf(*grid.first);
    std::vector<bool> taken(grid.members.size());
    for (std::size_t first = 0; first < taken.size(); ++first) {
      if (taken[first]) continue;
      taken[first] = true;
      std::vector<std::size_t> group = {first};
      for (std::size_t done = 0; done < group.size(); ++done) {
        const geo::TileRange pixels = grid.members[group[done]].pixels();
        for (std::size_t i = 0; i < taken.size(); ++i) {
          if (taken[i]) continue;
          const auto column = ColumnBeside(pixels, grid.members[i], turn);
          if (!column) continue;
          grid.members[i].column = *column;
          taken[i] = true;
          group.push_back(i);
        }
      }
      std::ranges::sort(group);
      std::vector<SheetMember> members;
      for (const std::size_t i : group) members.push_back(grid.members[i]);
      plans.emplace_back(grid.order[first], PlanOf(std::move(members), turn));
    }
  }
  std::ranges::sort(plans, {}, [](const auto& plan) { return plan.first; });
  std::vector<SheetPlan> sorted;
  for (auto& [place, plan] : plans) sorted.push_back(std::move(plan));
  return sorted;
}

}  // namespace terrace::dem

#include "engine/dem/content_below.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/crs/node_positions.h"
#include "engine/dem/dem_impl.h"
#include "engine/geo/tile_cover.h"

namespace terrace::dem {
namespace {

// The tiles around a square of tiles that touch an available tile in it, corners included, as offsets from `first`, its
// south-western tile. `side`: in tiles. Levels that edits add have few tiles; a square of them has a long rim.
std::vector<std::pair<std::int64_t, std::int64_t>> RimOf(const std::vector<geo::TileRange>& available,
                                                         const geo::TileKey& first, std::int64_t side) {
  std::vector<std::pair<std::int64_t, std::int64_t>> rim;
  for (const geo::TileRange& range : available) {
    const geo::TileRange inside = geo::Intersection(range, {first.x, first.y, first.x + side - 1, first.y + side - 1});
    if (geo::IsEmpty(inside)) continue;
    const std::int64_t west = inside.start_x - first.x - 1, east = inside.end_x - first.x + 1;
    const std::int64_t south = inside.start_y - first.y - 1, north = inside.end_y - first.y + 1;
    for (std::int64_t x = west; x <= east; ++x) {
      if (south == -1) rim.emplace_back(x, -1);
      if (north == side) rim.emplace_back(x, side);
    }
    for (std::int64_t y = south; y <= north; ++y) {
      if (west == -1) rim.emplace_back(-1, y);
      if (east == side) rim.emplace_back(side, y);
    }
  }
  std::ranges::sort(rim);
  rim.erase(std::unique(rim.begin(), rim.end()), rim.end());
  return rim;
}

// Whether an edit may ask for precision in the tile or within its width around it.
bool HasPrecisionAround(const EditSet& edits, const geo::Lattice& lattice, const geo::TileKey& tile) {
  Box box = BoxOf(lattice, WindowOfTile(lattice, tile));
  const double width = (lattice.cells + 1) * lattice.StepDegrees();
  box.Grow(width, width);
  return std::ranges::any_of(edits.Find(box),
                             [&](std::size_t number) { return edits.edits()[number].op == EditOp::kPrecision; });
}

}  // namespace

ContentHash ContentBelow(const ElevationModel& model, const geo::TileKey& top, int deepest) {
  const ElevationModel::Impl& impl = *model.impl_;
  TERRACE_CHECK(geo::IsValid(top) && top.level <= deepest && deepest <= geo::kMaxLevel);
  ContentHasher hasher;
  hasher.Add(impl.floor);
  hasher.Add(model.max_source_level());
  for (int level = top.level; level <= deepest; ++level) hasher.Add(impl.LatticeOf(level).cells);
  for (const std::size_t i : impl.GridsAt(top)) {
    const RasterGrid& grid = impl.grids[i];
    hasher.Add(impl.contents[i].grid);
    const std::vector<std::size_t> members = grid.MembersBelow(top, impl.lattices, deepest);
    hasher.Add(std::uint64_t{members.size()});
    for (const std::size_t member : members) {
      hasher.Add(impl.contents[i].members[member]);
      hasher.Add(grid.members()[member].column);
      hasher.Add(grid.members()[member].row);
      // A void may be a hole because of rasters far away.
      const auto holes = grid.HoleRegions(member);
      hasher.AddText({reinterpret_cast<const char*>(holes.data()), holes.size()});
    }
  }
  const std::vector<std::size_t> own =
      impl.EditsAt(impl.LatticeOf(top.level), WindowOfTile(impl.LatticeOf(top.level), top));
  for (const std::size_t edit : own) hasher.Add(impl.edits->edits()[edit].hash);
  if (impl.edits != nullptr && HasPrecisionAround(*impl.edits, impl.LatticeOf(top.level), top)) {
    // Corners on the rim have steps that also depend on edges outside.
    std::set<std::size_t> beyond;
    for (int level = top.level; level <= deepest; ++level) {
      const int down = level - top.level;
      const std::int64_t side = std::int64_t{1} << down, last = side - 1;
      for (std::int64_t at = 0; at < side; ++at) {
        for (const auto& [dx, dy] : {std::pair{at, std::int64_t{0}}, {at, last}, {std::int64_t{0}, at}, {last, at}}) {
          impl.AddPrecisionBeyondCorners({level, (top.x << down) + dx, (top.y << down) + dy}, beyond);
        }
      }
    }
    for (const std::size_t edit : own) beyond.erase(edit);
    for (const std::size_t edit : beyond) hasher.Add(impl.edits->edits()[edit].hash);
  }
  // The floor in the datum of a source (ReadInSourceDatum) comes from the last raster grid with a geoid.
  for (std::size_t i = impl.grids.size(); i-- > 0 && impl.floor_undulations != nullptr;) {
    if (impl.grids[i].vertical().geoid == nullptr) continue;
    hasher.Add(impl.contents[i].grid);
    break;
  }
  // Edges depend on the ranges of the tiles on both sides. Ranges are hashed instead of the samples that they come
  // from, so that a source beyond the neighbours does not matter.
  const auto add_range = [&](const geo::TileKey& key) {
    if (key.y < 0 || key.y >= geo::TileRows(key.level)) return;
    const HeightRange range = model.RangeBound(key);
    hasher.Add(range.min);
    hasher.Add(range.max);
  };
  for (int level = top.level; level <= deepest; ++level) {
    const int down = level - top.level;
    const std::int64_t side = std::int64_t{1} << down;
    const geo::TileKey first{level, top.x << down, top.y << down};
    if (level > model.max_source_level()) {
      for (const auto& [dx, dy] : RimOf(model.Available(level), first, side)) {
        hasher.Add(dx);
        hasher.Add(dy);
        add_range(geo::Neighbour(first, static_cast<int>(dx), static_cast<int>(dy)));
      }
      continue;
    }
    for (std::int64_t at = -1; at <= side; ++at) {
      for (const auto& [dx, dy] : {std::pair{at, std::int64_t{-1}}, {at, side}, {std::int64_t{-1}, at}, {side, at}}) {
        add_range(geo::Neighbour(first, static_cast<int>(dx), static_cast<int>(dy)));
      }
    }
  }
  // At a pole, edges depend on the range of the whole dataset.
  if (top.y == 0 || top.y == geo::TileRows(top.level) - 1) {
    hasher.Add(model.info().heights.min);
    hasher.Add(model.info().heights.max);
  }
  return hasher.Hash();
}

}  // namespace terrace::dem

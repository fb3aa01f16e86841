// The hash of all that the tiles of a subtree depend on.
#include <algorithm>
#include <cstdint>

#include "engine/core/check.h"
#include "engine/dem/crs/node_positions.h"
#include "engine/dem/dem_impl.h"

namespace terrace::dem {

ContentHash DemSource::ContentBelow(const geo::TileKey& top, int deepest) const {
  TERRACE_CHECK(geo::IsValid(top) && top.level <= deepest && deepest <= geo::kMaxLevel);
  ContentHasher hasher;
  hasher.Add(impl_->floor);
  hasher.Add(finest_level());
  for (int level = top.level; level <= deepest; ++level) hasher.Add(impl_->LatticeOf(level).cells);
  for (const std::size_t i : impl_->GridsNear(top)) {
    const RasterGrid& grid = impl_->grids[i];
    hasher.Add(impl_->contents[i].grid);
    const std::vector<std::size_t> members = grid.MembersBelow(top, impl_->lattices, deepest);
    hasher.Add(std::uint64_t{members.size()});
    for (const std::size_t member : members) {
      hasher.Add(impl_->contents[i].members[member]);
      hasher.Add(grid.members()[member].column);
      hasher.Add(grid.members()[member].row);
      // A void may be a hole because of rasters far away.
      const auto closed = grid.ClosedVoids(member);
      hasher.AddText({reinterpret_cast<const char*>(closed.data()), closed.size()});
    }
  }
  for (const std::size_t edit :
       impl_->EditsAt(impl_->LatticeOf(top.level), WindowOfTile(impl_->LatticeOf(top.level), top))) {
    hasher.Add(impl_->edits->edits()[edit].hash);
  }
  // The floor in the datum of a source (ReadInSourceDatum) comes from the last raster grid with a geoid.
  for (std::size_t i = impl_->grids.size(); i-- > 0 && impl_->floor_undulations != nullptr;) {
    if (impl_->grids[i].vertical().geoid == nullptr) continue;
    hasher.Add(impl_->contents[i].grid);
    break;
  }
  // Edges depend on the ranges of the tiles on both sides. Ranges are hashed instead of the samples that they come
  // from, so that a source beyond the neighbours does not matter.
  const auto add_range = [&](const geo::TileKey& key) {
    if (key.y < 0 || key.y >= geo::TileRows(key.level)) return;
    const HeightRange range = RangeBound(key);
    hasher.Add(range.min);
    hasher.Add(range.max);
  };
  for (int level = top.level; level <= deepest; ++level) {
    const int down = level - top.level;
    const std::int64_t side = std::int64_t{1} << down;
    const geo::TileKey first{level, top.x << down, top.y << down};
    for (std::int64_t at = -1; at <= side; ++at) {
      for (const auto& [dx, dy] : {std::pair{at, std::int64_t{-1}}, {at, side}, {std::int64_t{-1}, at}, {side, at}}) {
        add_range(geo::Neighbour(first, static_cast<int>(dx), static_cast<int>(dy)));
      }
    }
  }
  // At a pole, edges depend on the range of the whole dataset.
  if (top.y == 0 || top.y == geo::TileRows(top.level) - 1) {
    hasher.Add(info().heights.min);
    hasher.Add(info().heights.max);
  }
  return hasher.Hash();
}

}  // namespace terrace::dem

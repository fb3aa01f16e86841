// Levels that edits add below those of the sources.
#include <algorithm>
#include <cstdint>
#include <utility>

#include "engine/common/content_hash.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/tile_edits.h"
#include "engine/edits/deeper_tiles.h"
#include "engine/geo/tile_cover.h"
#include "engine/mosaic/availability.h"

namespace terrace::dem {

// Lattices of deeper levels have as many cells as the deepest level of the sources, so that each is twice as fine as
// the one above it.
void ElevationModel::Impl::AddDeeperLevels(double error_fraction) {
  const int deepest = std::min(info.max_source_level + kMaxDeeperLevels, geo::kMaxLevel);
  std::vector<FinerTiles> finer;
  for (const Edit& edit : edits->edits()) {
    const int level = LevelFor(edit, error_fraction, deepest);
    if (level > 0) finer.push_back({level, TilesTouching(edit, level)});
  }
  if (finer.empty()) return;
  const std::vector<std::vector<geo::TileRange>> added = AddTiles(available, finer);
  if (std::ranges::all_of(added, [](const auto& tiles) { return tiles.empty(); })) return;
  ancestors_of_added.resize(added.size());
  for (std::size_t level = added.size() - 1; level > 0; --level) {
    std::vector<geo::TileRange>& parents = ancestors_of_added[level - 1];
    std::vector<geo::TileRange> children = added[level];
    children.insert(children.end(), ancestors_of_added[level].begin(), ancestors_of_added[level].end());
    for (const geo::TileRange& range : children) {
      parents.push_back({range.start_x >> 1, range.start_y >> 1, range.end_x >> 1, range.end_y >> 1});
    }
    parents = geo::Disjoint(std::move(parents));
  }
  info.max_level = static_cast<int>(available.size()) - 1;
  for (int level = info.max_source_level + 1; level <= info.max_level; ++level) {
    lattices[static_cast<std::size_t>(level)].cells = lattices[static_cast<std::size_t>(info.max_source_level)].cells;
  }
}

std::uint64_t TileEdits::DeeperTilesHash(const geo::TileKey& key) const {
  if (!geo::IsValid(key) || key.level >= static_cast<int>(model_.ancestors_of_added.size())) return 0;
  const auto& touched = model_.ancestors_of_added[static_cast<std::size_t>(key.level)];
  if (!geo::Contains(touched, key)) return 0;
  const ElevationModel::Impl::HashKey memo_key = {key.level, key.x, key.y, -1, -1};
  if (const auto known = model_.KnownHash(memo_key)) return *known;
  ContentHasher hasher;
  for (int level = key.level + 1; level <= model_.info.max_level; ++level) {
    const auto tiles = geo::RangesBelow(model_.available[static_cast<std::size_t>(level)], key, level);
    if (tiles.empty()) break;  // and none on deeper levels
    hasher.Add(std::uint64_t{tiles.size()});
    for (const geo::TileRange& range : tiles) {
      for (const std::int64_t number : {range.start_x, range.start_y, range.end_x, range.end_y}) hasher.Add(number);
    }
  }
  const std::uint64_t hash = hasher.Hash().low | 1;
  model_.KeepHash(memo_key, hash);
  return hash;
}

std::span<const std::vector<geo::TileRange>> TileEdits::AvailabilityToDepthOf(const geo::TileKey& key) const {
  const std::span<const std::vector<geo::TileRange>> all = model_.available;
  std::size_t levels = all.size();
  const auto least = static_cast<std::size_t>(model_.info.max_source_level) + 1;
  const auto has_none = [&](std::size_t level) {
    return static_cast<int>(level) > key.level && std::ranges::none_of(all[level], [&](const geo::TileRange& range) {
             return !geo::IsEmpty(geo::Intersection(range, geo::TilesBelow(key, static_cast<int>(level))));
           });
  };
  while (levels > least && has_none(levels - 1)) --levels;
  return all.first(levels);
}

}  // namespace terrace::dem

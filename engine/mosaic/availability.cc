#include "engine/mosaic/availability.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <utility>

#include "engine/geo/tile_cover.h"

namespace terrace::dem {
namespace {

using Ranges = std::vector<geo::TileRange>;

// Limit of ranges: each takes sixty bytes in layer.json, which clients read before their first tile.
constexpr std::size_t kMaxBlocks = 2000;

Ranges Up(const Ranges& ranges, int levels) {
  Ranges up;
  for (const geo::TileRange& range : ranges) {
    up.push_back({range.start_x >> levels, range.start_y >> levels, range.end_x >> levels, range.end_y >> levels});
  }
  return geo::Disjoint(std::move(up));
}

Ranges Down(Ranges ranges, int levels) {
  for (geo::TileRange& range : ranges) {
    range = {range.start_x << levels, range.start_y << levels, ((range.end_x + 1) << levels) - 1,
             ((range.end_y + 1) << levels) - 1};
  }
  return ranges;
}

Ranges Merged(Ranges ranges, const Ranges& others) {
  ranges.insert(ranges.end(), others.begin(), others.end());
  return geo::Disjoint(std::move(ranges));
}

// The ranges with the tiles around them.
Ranges Grown(const Ranges& ranges, int level) {
  const std::int64_t columns = geo::TileColumns(level), last_row = geo::TileRows(level) - 1;
  Ranges grown;
  for (const geo::TileRange& range : ranges) {
    const std::int64_t south = std::max<std::int64_t>(range.start_y - 1, 0);
    const std::int64_t north = std::min(range.end_y + 1, last_row);
    grown.push_back(
        {std::max<std::int64_t>(range.start_x - 1, 0), south, std::min(range.end_x + 1, columns - 1), north});
    if (range.start_x == 0) grown.push_back({columns - 1, south, columns - 1, north});
    if (range.end_x == columns - 1) grown.push_back({0, south, 0, north});
  }
  return grown;
}

// The tiles of `ranges` that are not in `others`.
Ranges Without(Ranges ranges, const Ranges& others) {
  for (const geo::TileRange& other : others) {
    Ranges left;
    for (const geo::TileRange& range : ranges) {
      const geo::TileRange common = geo::Intersection(range, other);
      if (geo::IsEmpty(common)) {
        left.push_back(range);
        continue;
      }
      const geo::TileRange around[] = {{range.start_x, range.start_y, range.end_x, common.start_y - 1},
                                       {range.start_x, common.start_y, common.start_x - 1, common.end_y},
                                       {common.end_x + 1, common.start_y, range.end_x, common.end_y},
                                       {range.start_x, common.end_y + 1, range.end_x, range.end_y}};
      std::ranges::remove_copy_if(around, std::back_inserter(left), geo::IsEmpty);
    }
    ranges = std::move(left);
  }
  return geo::Disjoint(std::move(ranges));
}

// Four children or none; few ranges.
void Complete(Ranges& tiles, int level) {
  tiles = Down(Up(tiles, 1), 1);
  for (int coarser = 1; tiles.size() > kMaxBlocks && coarser <= level; ++coarser) {
    tiles = geo::Disjoint(Down(Up(tiles, coarser), coarser));
  }
}

}  // namespace

std::vector<Ranges> AvailableTiles(std::span<const SourceExtent> sources) {
  const int deepest = std::ranges::max_element(sources, {}, &SourceExtent::deepest_level)->deepest_level;
  std::vector<Ranges> levels(static_cast<std::size_t>(deepest) + 1);
  // Every level is derived from the tiles of the deepest one, so that rounding cannot lose an ancestor.
  std::vector<Ranges> worth(levels.size());  // of the deepest level, by the deepest level of their source
  for (const SourceExtent& source : sources) {
    const Ranges tiles = TilesOverlapping(source.footprint, deepest);
    Ranges& those = worth[static_cast<std::size_t>(source.deepest_level)];
    those.insert(those.end(), tiles.begin(), tiles.end());
  }
  Ranges wanted;  // of the deepest level: of sources that reach the current level
  for (int level = deepest; level > 0; --level) {
    const int up = deepest - level;
    Ranges& here = levels[static_cast<std::size_t>(level)];
    wanted = Merged(std::move(wanted), worth[static_cast<std::size_t>(level)]);
    here = Up(wanted, up);
    if (level < deepest) here = Merged(std::move(here), Up(levels[static_cast<std::size_t>(level) + 1], 1));
    Complete(here, level);
  }
  levels[0] = {{0, 0, 1, 0}};
  return levels;
}

std::vector<Ranges> AddTiles(std::vector<Ranges>& levels, std::span<const FinerTiles> finer) {
  if (finer.empty()) return {};
  const int deepest = std::ranges::max_element(finer, {}, &FinerTiles::level)->level;
  levels.resize(std::max(levels.size(), static_cast<std::size_t>(deepest) + 1));
  std::vector<Ranges> own(static_cast<std::size_t>(deepest) + 1);
  for (const FinerTiles& of_level : finer) {
    Ranges& those = own[static_cast<std::size_t>(of_level.level)];
    those.insert(those.end(), of_level.tiles.begin(), of_level.tiles.end());
  }
  std::vector<Ranges> added(levels.size());
  Ranges parents;  // of the tiles of the level below, and of those around the ones that were added
  for (int level = deepest; level > 0; --level) {
    Ranges& here = levels[static_cast<std::size_t>(level)];
    const Ranges before = here;
    here = Merged(Merged(std::move(here), own[static_cast<std::size_t>(level)]), parents);
    Complete(here, level);
    added[static_cast<std::size_t>(level)] = Without(here, before);
    parents = Merged(Up(here, 1), Up(Grown(added[static_cast<std::size_t>(level)], level), 1));
  }
  return added;
}

}  // namespace terrace::dem

#include "engine/dem/mosaic/availability.h"

#include <algorithm>

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

// Four children or none; few ranges.
void Complete(Ranges& tiles, int level) {
  tiles = Down(Up(tiles, 1), 1);
  for (int coarser = 1; tiles.size() > kMaxBlocks && coarser <= level; ++coarser) {
    tiles = geo::Disjoint(Down(Up(tiles, coarser), coarser));
  }
}

}  // namespace

std::vector<Ranges> AvailableTiles(std::span<const SourceExtent> sources) {
  const int deepest = std::ranges::max_element(sources, {}, &SourceExtent::depth)->depth;
  std::vector<Ranges> levels(static_cast<std::size_t>(deepest) + 1);
  // Every level is derived from the tiles of the deepest one, so that rounding cannot lose an ancestor.
  std::vector<Ranges> worth(levels.size());  // of the deepest level, by the depth of their source
  for (const SourceExtent& source : sources) {
    const Ranges tiles = TilesTouching(source.footprint, deepest);
    Ranges& those = worth[static_cast<std::size_t>(source.depth)];
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

void AddTiles(std::vector<Ranges>& levels, std::span<const FinerTiles> finer) {
  if (finer.empty()) return;
  const int deepest = std::ranges::max_element(finer, {}, &FinerTiles::level)->level;
  levels.resize(std::max(levels.size(), static_cast<std::size_t>(deepest) + 1));
  std::vector<Ranges> own(static_cast<std::size_t>(deepest) + 1);
  for (const FinerTiles& of_level : finer) {
    Ranges& those = own[static_cast<std::size_t>(of_level.level)];
    those.insert(those.end(), of_level.tiles.begin(), of_level.tiles.end());
  }
  Ranges parents;  // of the tiles of the level below
  for (int level = deepest; level > 0; --level) {
    Ranges& here = levels[static_cast<std::size_t>(level)];
    here = Merged(Merged(std::move(here), own[static_cast<std::size_t>(level)]), parents);
    Complete(here, level);
    parents = Up(here, 1);
  }
}

}  // namespace terrace::dem

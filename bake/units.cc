#include "bake/units.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "archive/unit_name.h"
#include "engine/geo/tile_cover.h"
#include "proto/documents/subtree.h"

namespace terrace::bake {
namespace {

std::uint64_t ZOrder(const geo::TileKey& key) {
  return proto::MortonIndex(static_cast<std::uint32_t>(key.x), static_cast<std::uint32_t>(key.y));
}

bool HasTileIn(const std::vector<geo::TileRange>& ranges, const geo::TileRange& box) {
  return std::ranges::any_of(ranges,
                             [&](const geo::TileRange& range) { return !geo::IsEmpty(geo::Intersection(range, box)); });
}

// Whether there are tiles below `key`. Ancestors of tiles exist, except on the first levels of a pyramid, which may be
// empty as a whole.
bool HasTilesBelow(const Pyramid& tiles, const geo::TileKey& key, int last_level) {
  for (int level = key.level + 1; level <= last_level; ++level) {
    const auto& ranges = tiles[static_cast<std::size_t>(level)];
    if (!ranges.empty()) return HasTileIn(ranges, geo::TilesBelow(key, level));
  }
  return false;
}

bool WalkBelow(const Pyramid& tiles, const geo::TileKey& key, int last_level,
               const std::function<bool(const geo::TileKey&)>& visit) {
  if (HasTileIn(tiles[static_cast<std::size_t>(key.level)], {key.x, key.y, key.x, key.y}) && !visit(key)) return false;
  if (!HasTilesBelow(tiles, key, last_level)) return true;
  for (const auto& [dx, dy] : std::array<std::pair<int, int>, 4>{{{0, 0}, {1, 0}, {0, 1}, {1, 1}}}) {
    if (!WalkBelow(tiles, {key.level + 1, 2 * key.x + dx, 2 * key.y + dy}, last_level, visit)) return false;
  }
  return true;
}

}  // namespace

std::uint64_t CountTiles(const Pyramid& pyramid) {
  std::uint64_t count = 0;
  for (const auto& ranges : pyramid) {
    for (const geo::TileRange& range : ranges) count += static_cast<std::uint64_t>(geo::Cells(range));
  }
  return count;
}

std::vector<Unit> UnitsOf(const Pyramid& pyramid) {
  const int levels = static_cast<int>(pyramid.size());
  std::map<std::uint64_t, Unit> subtrees;  // by Z-order
  for (int level = archive::kTopLevels; level < levels; ++level) {
    const int up = level - archive::kTopLevels;
    for (const geo::TileRange& range : pyramid[static_cast<std::size_t>(level)]) {
      for (std::int64_t y = range.start_y >> up; y <= range.end_y >> up; ++y) {
        for (std::int64_t x = range.start_x >> up; x <= range.end_x >> up; ++x) {
          const geo::TileKey root{archive::kTopLevels, x, y};
          Unit& unit = subtrees[ZOrder(root)];
          if (!unit.root) unit = {archive::UnitNameOf(root), root, Pyramid(pyramid.size())};
          unit.tiles[static_cast<std::size_t>(level)].push_back(geo::Intersection(range, geo::TilesBelow(root, level)));
        }
      }
    }
  }
  std::vector<Unit> units;
  units.reserve(subtrees.size() + 1);
  for (auto& [order, unit] : subtrees) units.push_back(std::move(unit));
  Unit top{"top", std::nullopt, pyramid};
  top.tiles.resize(static_cast<std::size_t>(std::min(levels, archive::kTopLevels)));
  if (CountTiles(top.tiles) > 0) units.push_back(std::move(top));
  return units;
}

std::vector<Part> PartsOf(const Unit& unit) {
  // 64 subtrees are enough for the cores of one machine, and each has enough tiles to share blocks.
  constexpr int kLevelsAbove = 3;
  const int last = static_cast<int>(unit.tiles.size()) - 1;
  std::vector<geo::TileKey> roots;
  if (unit.root) {
    roots = {*unit.root};
  } else {
    roots = {{0, 0, 0}, {0, 1, 0}};
  }
  const int split = roots.front().level + kLevelsAbove;
  std::vector<Part> parts;
  for (const geo::TileKey& root : roots) {
    parts.push_back({root, std::min(last, split - 1)});
    if (split > last) continue;
    const geo::TileRange below = geo::TilesBelow(root, split);
    std::vector<geo::TileKey> subtrees;
    for (std::int64_t y = below.start_y; y <= below.end_y; ++y) {
      for (std::int64_t x = below.start_x; x <= below.end_x; ++x) subtrees.push_back({split, x, y});
    }
    std::ranges::sort(subtrees, {}, ZOrder);
    for (const geo::TileKey& subtree : subtrees) {
      const bool has_own =
          HasTileIn(unit.tiles[static_cast<std::size_t>(split)], {subtree.x, subtree.y, subtree.x, subtree.y});
      if (has_own || HasTilesBelow(unit.tiles, subtree, last)) parts.push_back({subtree, last});
    }
  }
  return parts;
}

bool Walk(const Pyramid& tiles, const Part& part, const std::function<bool(const geo::TileKey&)>& visit) {
  return WalkBelow(tiles, part.root, part.last_level, visit);
}

}  // namespace terrace::bake

#include "tiler/tileset_documents.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_cover.h"
#include "proto/documents/subtree.h"
#include "proto/documents/tileset.h"
#include "proto/mesh/skirt.h"

namespace terrace::tiler {
namespace {

double SkirtDepth(const TileTree& tree, int level) {
  const bool is_deepest = level >= tree.deepest_level;
  return proto::SkirtDepth(level, proto::SkirtError(level, tree.error_step(level), is_deepest, tree.error_fraction));
}

// Returns a range that contains the heights of all vertices, including skirts, of the tile and its descendants at this
// error. It is the bound on the tile's samples, widened by skirts and rounding, and then outwards to multiples of a
// power of two, which is at most a quarter of the error and at least 2^-6 m: such numbers are short and often equal.
// Reads no raster. Thread-safe. Precondition: a valid key.
proto::HeightSpan TileHeightSpan(const TileTree& tree, const geo::TileKey& key) {
  const double error_m = geo::LadderError(key.level, tree.error_step(key.level), tree.error_fraction);
  // Skirts are shorter on each deeper level, except on the deepest level at a small `fraction`.
  const double skirt_m = std::max(SkirtDepth(tree, key.level), SkirtDepth(tree, tree.deepest_level));
  // Positions are rounded to a grid of at most a 32nd of the error; the lower rims of skirts are rounded twice.
  const double rounding_m = error_m / 32;
  const dem::HeightRange range = tree.range(key);
  constexpr int kFinestStep = -6;
  const double unit_m = std::ldexp(1, std::max(std::ilogb(error_m / 4), kFinestStep));
  return {std::floor((range.min - skirt_m - 2 * rounding_m) / unit_m) * unit_m,
          std::ceil((range.max + rounding_m) / unit_m) * unit_m};
}

// The ranges of one level that touch the columns west .. east, in degrees, and the dataset's rows.
std::vector<geo::TileRange> TilesWithin(const TileTree& tree, int level, double west, double east) {
  const double tile = std::ldexp(180, -level);
  const auto first = [&](double degrees) { return static_cast<std::int64_t>(std::floor(degrees / tile)); };
  const auto last = [&](double degrees) { return static_cast<std::int64_t>(std::ceil(degrees / tile)) - 1; };
  geo::TileRange box{first(west + 180), first(tree.bounds.south + 90), last(east + 180), last(tree.bounds.north + 90)};
  box.end_x = std::max(box.start_x, box.end_x);
  box.end_y = std::max(box.start_y, box.end_y);
  std::vector<geo::TileRange> tiles;
  for (const geo::TileRange& range : tree.available[static_cast<std::size_t>(level)]) {
    if (const geo::TileRange common = geo::Intersection(range, box); !geo::IsEmpty(common)) tiles.push_back(common);
  }
  return tiles;
}

// The available tiles that touch the dataset's bounds. Other tiles are available only so that parents have four
// children.
std::vector<std::vector<geo::TileRange>> TilesWithData(const TileTree& tree) {
  std::vector<std::vector<geo::TileRange>> levels;
  const double west = tree.bounds.west, east = tree.bounds.east;
  const bool crosses = west > east;
  for (int level = 0; level < static_cast<int>(tree.available.size()); ++level) {
    auto& tiles = levels.emplace_back(TilesWithin(tree, level, west, crosses ? 180 : east));
    if (!crosses) continue;
    for (const geo::TileRange& range : TilesWithin(tree, level, -180, east)) tiles.push_back(range);
    tiles = geo::Disjoint(std::move(tiles));
  }
  return levels;
}

}  // namespace

std::vector<proto::TreeRoot> TreesOf(const TileTree& tree) {
  const std::vector<std::vector<geo::TileRange>> with_data = TilesWithData(tree);
  // The bounds in the manifest of a damaged archive may touch no tile.
  return proto::ImplicitTrees(tree.available, proto::ImplicitRoots(with_data[0].empty() ? tree.available : with_data));
}

std::string TilesetJson(const TileTree& tree, const std::vector<proto::TreeRoot>& roots,
                        const std::string& content_query, const std::string& subtree_query, bool has_versions) {
  proto::TilesetDescription tileset;
  tileset.version = tree.version;
  tileset.has_versioned_urls = has_versions;
  tileset.attribution = tree.attribution;
  tileset.roots = roots;
  tileset.heights = [&](const geo::TileKey& key) { return TileHeightSpan(tree, key); };
  tileset.content_query = content_query;
  tileset.subtree_query = subtree_query;
  return proto::EncodeTileset(tileset);
}

std::string SubtreeOf(const TileTree& tree, const geo::TileKey& top, int levels, const std::stop_token& stop) {
  proto::Subtree subtree;
  subtree.levels = levels;
  subtree.tiles = proto::BlocksBelow(tree.available, top, levels);
  subtree.heights = [&](const geo::TileKey& below) {
    if (stop.stop_requested()) return proto::HeightSpan();
    return TileHeightSpan(tree, proto::TileUnder(top, below.level, below.x, below.y));
  };
  return proto::EncodeSubtree(subtree);
}

}  // namespace terrace::tiler

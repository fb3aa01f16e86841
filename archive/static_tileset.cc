#include "archive/static_tileset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "engine/geo/tile_key.h"
#include "proto/documents/implicit_tree.h"
#include "tiler/encoder_version.h"
#include "tiler/tileset_documents.h"

namespace terrace::archive {
namespace {

using proto::TreeRoot;

// The tree that a server makes if the dataset has this archive and no sources.
tiler::TileTree TreeOf(const Archive& archive) {
  const Manifest& manifest = archive.manifest();
  const BakedDataset& dataset = manifest.dataset;
  const dem::HeightRange all{std::min(dataset.heights.min, dataset.floor_m),
                             std::max(dataset.heights.max, dataset.floor_m)};
  return {tiler::VersionText(TilesHash(manifest)),
          dataset.attribution,
          manifest.available,
          dataset.bounds,
          dataset.error_fraction,
          dataset.max_source_level,
          [&archive, all](const geo::TileKey& key) { return archive.FindRange(key).value_or(all).value_or(all); },
          [&manifest](int level) { return manifest.StepAt(level); }};
}

// The paths of tiles in the trees.
class Paths {
 public:
  explicit Paths(const std::vector<TreeRoot>& roots) {
    for (const TreeRoot& root : roots) Add(root);
  }

  // Nothing: the tileset does not name the tile.
  std::optional<std::string> PathOf(const geo::TileKey& key) const {
    for (int up = 0; up <= key.level; ++up) {
      const auto found = trees_.find({key.level - up, key.x >> up, key.y >> up});
      if (found == trees_.end()) continue;
      const geo::TileKey root = {key.level - up, key.x >> up, key.y >> up};
      if (up >= found->second) return std::nullopt;
      return fmt::format("3dtiles/{}/{}/{}/{}.glb", proto::RootName(root), up, key.x - (root.x << up),
                         key.y - (root.y << up));
    }
    return std::nullopt;
  }

 private:
  using Key = std::tuple<int, std::int64_t, std::int64_t>;

  void Add(const TreeRoot& tree) {
    trees_.emplace(Key(tree.tile.level, tree.tile.x, tree.tile.y), tree.below.empty() ? tree.levels : 1);
    for (const TreeRoot& root : tree.below) Add(root);
  }

  std::map<Key, int> trees_;  // by root: the number of levels; 1 if there are further roots below it
};

// Calls `take` for the subtrees whose roots are the tiles of `block`. `level`: that of the tiles, in the tree.
// `levels`: of each subtree.
Result<void> TakeSubtreesOf(const geo::TileRange& block, int level, int levels, const tiler::TileTree& tiles,
                            const TreeRoot& tree, const TakeFile& take, const std::stop_token& stop) {
  for (std::int64_t y = block.start_y; y <= block.end_y; ++y) {
    for (std::int64_t x = block.start_x; x <= block.end_x; ++x) {
      if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
      const std::string path =
          fmt::format("3dtiles/{}/{}/{}/{}.{}.subtree", proto::RootName(tree.tile), level, x, y, levels);
      const std::string subtree = tiler::SubtreeOf(tiles, proto::TileUnder(tree.tile, level, x, y), levels, stop);
      if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
      if (Result<void> taken = take(path, subtree, /*is_gzip=*/false); !taken) return taken;
    }
  }
  return {};
}

Result<void> TakeSubtrees(const tiler::TileTree& tiles, const TreeRoot& tree, const TakeFile& take,
                          const std::stop_token& stop) {
  for (const TreeRoot& root : tree.below) {
    if (Result<void> taken = TakeSubtrees(tiles, root, take, stop); !taken) return taken;
  }
  if (!tree.below.empty()) return {};
  const int levels = proto::SubtreeLevels(tree.levels);
  for (int level = 0; level < tree.levels; level += levels) {
    const auto blocks = proto::BlocksBelow(tiles.available, tree.tile, level);
    for (const geo::TileRange& block : blocks.back()) {
      if (Result<void> taken = TakeSubtreesOf(block, level, levels, tiles, tree, take, stop); !taken) return taken;
    }
  }
  return {};
}

}  // namespace

Result<void> ForEachFileOfTileset(const Archive& archive, bool has_versions, const TakeFile& take,
                                  const std::stop_token& stop) {
  const tiler::TileTree tiles = TreeOf(archive);
  const std::vector<TreeRoot> roots = tiler::TreesOf(tiles);
  const std::string tileset = tiler::TilesetJson(tiles, roots, "", "", has_versions);
  if (Result<void> taken = take("tileset.json", tileset, /*is_gzip=*/false); !taken) return taken;
  for (const TreeRoot& root : roots) {
    if (Result<void> taken = TakeSubtrees(tiles, root, take, stop); !taken) return taken;
  }
  const Paths paths(roots);
  const bool is_gzip = archive.manifest().kind.coding == tiler::Coding::kGzip;
  return archive.ForEach([&](const geo::TileKey& key, const ArchivedTile& tile) -> Result<void> {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
    const std::optional<std::string> path = paths.PathOf(key);
    return path ? take(*path, tile.tile.bytes, is_gzip) : Result<void>();
  });
}

}  // namespace terrace::archive

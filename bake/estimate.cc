#include "bake/estimate.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>

#include "bake/bake_request.h"
#include "engine/geo/tile_cover.h"

namespace terrace::bake {
namespace {

constexpr double kMillisecondsPerHour = 3600e3;

// The tile with number `at`, from 0, in the list of all tiles of a level.
geo::TileKey TileAt(const std::vector<geo::TileRange>& ranges, int level, std::uint64_t at) {
  for (const geo::TileRange& range : ranges) {
    const auto cells = static_cast<std::uint64_t>(geo::Cells(range));
    if (at < cells) {
      const auto columns = static_cast<std::uint64_t>(range.end_x - range.start_x + 1);
      return {level, range.start_x + static_cast<std::int64_t>(at % columns),
              range.start_y + static_cast<std::int64_t>(at / columns)};
    }
    at -= cells;
  }
  return {level, ranges.back().end_x, ranges.back().end_y};
}

// Groups of four siblings, spread over the level.
std::vector<geo::TileKey> SamplesOf(const std::vector<geo::TileRange>& ranges, int level, std::uint64_t count) {
  constexpr std::uint64_t kGroups = 8;
  std::vector<geo::TileKey> samples;
  std::set<std::pair<std::int64_t, std::int64_t>> parents;
  for (std::uint64_t i = 0; i < std::min(kGroups, count); ++i) {
    // In the middle of each eighth: the rim of the data is cheaper than most tiles.
    const geo::TileKey tile = TileAt(ranges, level, count * (2 * i + 1) / (2 * std::min(kGroups, count)));
    const std::int64_t x = tile.x / 2, y = tile.y / 2;
    if (!parents.emplace(x, y).second) continue;
    for (const geo::TileKey& key : {geo::TileKey{level, 2 * x, 2 * y}, geo::TileKey{level, 2 * x + 1, 2 * y},
                                    geo::TileKey{level, 2 * x, 2 * y + 1}, geo::TileKey{level, 2 * x + 1, 2 * y + 1}}) {
      if (geo::Contains(ranges, key)) samples.push_back(key);
    }
  }
  return samples;
}

// Units of a single tile exist only so that parents have four children.
bool ReachesDown(const Unit& unit) { return !unit.root || CountTiles(unit.tiles) > 1; }

Estimate Sum(std::vector<LevelEstimate> levels) {
  Estimate estimate;
  estimate.levels = std::move(levels);
  for (const LevelEstimate& level : estimate.levels) {
    const auto tiles = static_cast<double>(level.tiles);
    estimate.tiles += level.tiles;
    estimate.bytes += tiles * level.bytes_per_tile;
    estimate.core_hours += tiles * level.milliseconds_per_tile / kMillisecondsPerHour;
  }
  return estimate;
}

}  // namespace

Result<Estimate> EstimateBake(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets,
                              const UnitPlan& plan, const std::stop_token& stop) {
  std::vector<LevelEstimate> levels;
  std::uint64_t sampled = 0;
  for (std::size_t target = 0; target < targets.size(); ++target) {
    const archive::Manifest& manifest = targets[target].manifest;
    for (int level = 0; level <= manifest.max_level; ++level) {
      Pyramid of_shard(1);
      for (const UnitPlan::Entry& entry : plan.units) {
        if (std::ranges::find(entry.targets, target) == entry.targets.end()) continue;
        if (level >= static_cast<int>(entry.unit.tiles.size())) continue;
        for (const geo::TileRange& range : entry.unit.tiles[static_cast<std::size_t>(level)])
          of_shard[0].push_back(range);
      }
      const std::uint64_t count = CountTiles(of_shard);
      if (count == 0) continue;
      std::uint64_t bytes = 0;
      const std::vector<geo::TileKey> samples = SamplesOf(of_shard[0], level, count);
      const auto start = std::chrono::steady_clock::now();
      for (const geo::TileKey& key : samples) {
        const auto tile = pipeline.Build(RequestOf(manifest, key), stop);
        if (!tile) return tl::unexpected(tile.error());
        bytes += tile->bytes.size();
      }
      const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - start;
      const auto each = [&](double sum) { return sum / static_cast<double>(samples.size()); };
      levels.push_back({archive::FolderOf(manifest.kind.format), level, count, each(static_cast<double>(bytes)),
                        each(took.count())});
      sampled += samples.size();
    }
  }
  Estimate estimate = Sum(std::move(levels));
  estimate.files = plan.files;
  for (const UnitPlan::Entry& entry : plan.units)
    estimate.subtree_files += ReachesDown(entry.unit) ? entry.targets.size() : 0;
  estimate.sampled = sampled;
  return estimate;
}

Estimate EstimateWith(const Pyramid& tiles, double bytes_per_tile, double milliseconds_per_tile) {
  std::vector<LevelEstimate> levels;
  for (std::size_t level = 0; level < tiles.size(); ++level) {
    levels.push_back({archive::FolderOf(tiler::TileFormat::kQuantizedMesh), static_cast<int>(level),
                      CountTiles({tiles[level]}), bytes_per_tile, milliseconds_per_tile});
  }
  Estimate estimate = Sum(std::move(levels));
  const std::vector<Unit> units = UnitsOf(tiles);
  estimate.files = units.size();
  estimate.subtree_files = static_cast<std::uint64_t>(std::ranges::count_if(units, ReachesDown));
  return estimate;
}

}  // namespace terrace::bake

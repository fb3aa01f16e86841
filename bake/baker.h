// Bakes the units of archives on several threads.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "archive/manifest.h"
#include "archive/unit_writer.h"
#include "bake/queue/unit_queue.h"
#include "bake/units.h"
#include "engine/core/result.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bake {

// Where tiles are baked to: an archive to be made, or, with `create` and `has`, a cache.
struct Target {
  std::string place;
  archive::Manifest manifest;  // without units
  // The older archive whose units with equal keys are copied: its folder, and its units by name.
  std::string old_place = {};
  std::map<std::string, archive::UnitEntry> old_units = {};
  // Where the tiles go instead of to files in `place`. `create` makes the writer of a unit; several threads
  // may call it at once, and one at a time uses the writer. Tiles for which `has` returns true exist already and are
  // not built. Both empty: files in `place`.
  std::function<Result<std::unique_ptr<archive::UnitWriter>>()> create = {};
  std::function<bool(const tiler::TileRequest&)> has = {};
};

// The share of one process in a bake that several processes divide.
struct Shard {
  std::uint32_t index = 0, count = 1;

  // Decided by a hash of the name, so that the units of a region are distributed evenly.
  bool Has(const std::string& unit) const;
};

enum class UnitOutcome : std::uint8_t {
  kBaked,
  kKept,    // its file was there already
  kCopied,  // taken from the old archive
  kFailed,
  // With only_verify:
  kMissing,   // there is no file
  kUnusable,  // its file is damaged, or of other sources or options
};

// A unit of one archive, done or given up.
struct UnitReport {
  std::size_t target = 0;
  archive::UnitEntry entry;  // of a failed unit only name and key
  UnitOutcome outcome = UnitOutcome::kBaked;
  double seconds = 0;
  std::string message;  // of a failed or unusable unit: why
};

// The progress over all archives, for displays.
struct Counters {
  std::atomic<std::uint64_t> tiles{0};    // built by this process
  std::atomic<std::uint64_t> bytes{0};    // of these tiles
  std::atomic<std::uint64_t> skipped{0};  // not built: in kept or copied units, or `Target::has` is true
  std::atomic<std::uint64_t> units{0};    // done or given up
  // Microseconds of all threads, by stage.
  std::atomic<std::uint64_t> read{0}, refine{0}, encode{0}, compress{0};
};

struct BakeOptions {
  unsigned threads = 1;
  bool only_verify = false;  // bake nothing: units without a right file are kMissing or kUnusable
  // Called for each unit, one call at a time. May be empty.
  std::function<void(const UnitReport&)> on_unit = {};
  std::stop_token stop = {};
};

// The units to bake. Formats with the same scheme and tiles share their units and are baked together, so that each tile
// is read and refined once.
struct UnitPlan {
  struct Entry {
    Unit unit;
    std::vector<std::size_t> targets;
  };
  std::vector<Entry> units;
  std::uint64_t tiles = 0, files = 0;  // of all archives

  static UnitPlan Make(const std::vector<Target>& targets, const Shard& shard);
};

// Bakes every unit that is not there yet. A unit that fails is tried again later, until UnitQueue::Fail gives
// it up. The others are baked nevertheless. Returns the
// reports in the order of the plan. After a stop, unfinished units have neither files nor reports. The files do not
// depend on the number of threads or on interruptions.
std::vector<UnitReport> Bake(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets,
                             const UnitPlan& plan, const BakeOptions& options, Counters& counters);

// The same with the units that `queue` hands out, which are units of the plan. Returns when the queue says kOver.
std::vector<UnitReport> Bake(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets,
                             const UnitPlan& plan, UnitQueue& queue, const BakeOptions& options, Counters& counters);

}  // namespace terrace::bake

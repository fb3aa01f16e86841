#include "server/cli/bake/seed_cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <stop_token>
#include <system_error>
#include <utility>

#include "archive/unit_writer.h"
#include "bake/bake_request.h"
#include "engine/core/plain_number.h"
#include "server/cli/bake/bake_display.h"
#include "server/cli/common/command.h"
#include "server/store/disk_cache.h"
#include "server/store/record_db.h"

namespace terrace::cli {
namespace {

using Json = nlohmann::ordered_json;
using tiler::CacheKey;

// The cache that is filled.
struct Seed {
  explicit Seed(const tiler::Dataset& seeded) : dataset(seeded) {}

  const tiler::Dataset& dataset;
  std::shared_ptr<tiler::TileStore> store;
  std::size_t limit_bytes = 0;          // from which the cache deletes its oldest records
  std::atomic<std::uint64_t> bytes{0};  // in the cache, approximate
  std::atomic<bool> is_full{false};
  std::stop_source stop;  // requested by signals, and when the cache is full

  // The key under which a server looks the tile up.
  CacheKey KeyOf(const tiler::TileRequest& request) const {
    return {request, dataset.cache_generation(), tiler::TileEditsHash(*dataset.model, request)};
  }
  // Counts a tile before it is inserted. False: it does not fit. The margin is for what `bytes` does not count: indexes
  // and filters of record files.
  bool Take(std::uint64_t more) {
    if ((bytes += more) <= limit_bytes - limit_bytes / 8) return true;
    is_full = true;
    stop.request_stop();
    return false;
  }
};

// The key, checksum and columns of a record.
constexpr std::uint64_t kRecordOverheadBytes = 160;

class SeedWriter final : public archive::UnitWriter {
 public:
  SeedWriter(Seed& seed, archive::Manifest manifest)
      : seed_(seed), manifest_(std::move(manifest)), dropped_before_(seed.store->stats().dropped) {}

  Result<void> Add(const geo::TileKey& key, const tiler::EncodedTile& tile, const dem::HeightRange&) override {
    if (!seed_.Take(tile.bytes.size() + kRecordOverheadBytes)) {
      return MakeError(ErrorCode::kCancelled, "the cache is full");
    }
    if (!IsWriting()) return NotWritten();  // before more tiles are built in vain
    ++summary_.tiles;
    summary_.bytes += tile.bytes.size();
    seed_.store->Insert(seed_.KeyOf(bake::RequestOf(manifest_, key)), std::make_shared<const tiler::EncodedTile>(tile));
    return {};
  }

  Result<archive::FileSummary> Finish() override {
    seed_.store->Flush();
    if (!IsWriting()) return NotWritten();
    return summary_;
  }

 private:
  bool IsWriting() const {
    const tiler::StoreStats stats = seed_.store->stats();
    return stats.on && stats.dropped == dropped_before_;
  }
  static tl::unexpected<Error> NotWritten() {
    return MakeError(ErrorCode::kUnavailable,
                     "the cache cannot be written; look at its disk, and run the same command again");
  }

  Seed& seed_;
  const archive::Manifest manifest_;
  const std::uint64_t dropped_before_;
  archive::FileSummary summary_;
};

std::uint64_t BytesOfRecords(const std::filesystem::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    if (entry.path().extension() != ".sst") continue;
    const std::uintmax_t size = entry.file_size(ignored);
    if (!ignored) bytes += size;
  }
  return bytes;
}

// Returns an exit code, after a message.
int OpenSeed(const std::string& folder, const config::DiskCacheConfig& limits, Seed& seed) {
  config::DiskCacheConfig tiles_alone = limits;
  tiles_alone.directory = folder;
  tiles_alone.refinement_bytes = 0;
  if (limits.tile_bytes == 0) {
    return cli::Fail("--into-cache: disk_cache of the configuration has no room for tiles: tile_bytes is 0",
                     kExitUsage);
  }
  seed.limit_bytes = server::RecordDb::RecordBytes(std::max(limits.tile_bytes, server::RecordDb::kMinCapacity));
  // Opened with a lower limit than its server's, the cache would lose tiles.
  if (const std::uint64_t there = BytesOfRecords(std::filesystem::path(folder) / "tiles"); there > seed.limit_bytes) {
    return cli::Fail(
        fmt::format("--into-cache {}: has {} of tiles, and the limit is {} (disk_cache.tile_bytes); give the "
                    "configuration of its server with --config",
                    folder, Bytes(static_cast<double>(there)), Bytes(static_cast<double>(limits.tile_bytes))),
        kExitUsage);
  }
  constexpr std::size_t kOpenFiles = 256;
  Result<server::DiskCache> cache = server::OpenDiskCache(tiles_alone, kOpenFiles, /*waits_for_room=*/true);
  if (!cache) {
    return cli::Fail(fmt::format("--into-cache: {}; a server must not run meanwhile", cache.error().message),
                     kExitUsage);
  }
  seed.store = cache->tiles;
  seed.bytes = seed.store->stats().bytes;
  if (seed.store->stats().on) return kExitOk;
  return cli::Fail(fmt::format("--into-cache {}: cannot be opened; see the warning above", folder), kExitFailure);
}

// Prints the result of a run that was not stopped. Returns the exit code.
int ReportSeed(const BakeArguments& arguments, const config::DiskCacheConfig& limits, const Seed& seed,
               const bake::UnitPlan& plan, const std::vector<bake::UnitReport>& reports,
               const bake::Counters& counters) {
  const std::string& folder = arguments.into_cache;
  const std::uint64_t built = counters.tiles, kept = counters.skipped;
  if (seed.is_full) {
    return cli::Fail(
        fmt::format("{}: is full after {} of {} tiles; raise disk_cache.tile_bytes ({} now) in the "
                    "configuration of the server, and give it with --config, or limit --levels or --bbox",
                    folder, Grouped(built + kept), Grouped(plan.tiles), Bytes(static_cast<double>(limits.tile_bytes))),
        kExitFailure);
  }
  bool is_whole = true;
  for (const bake::UnitReport& report : reports) {
    if (report.outcome != bake::UnitOutcome::kFailed) continue;
    is_whole = false;
    std::fprintf(stderr, "terrace: unit %s failed: %s\n", report.entry.name.c_str(), report.message.c_str());
  }
  if (arguments.json) {
    const Json json = {{"cache", folder},      {"complete", is_whole}, {"tiles", plan.tiles},
                       {"built_tiles", built}, {"kept_tiles", kept},   {"bytes", counters.bytes.load()}};
    fmt::print("{}\n", json.dump(-1, ' ', false, Json::error_handler_t::replace));
  } else {
    fmt::print("{}: {} tiles: {} built ({}), {} were there\n", folder, Grouped(plan.tiles), Grouped(built),
               Bytes(static_cast<double>(counters.bytes)), Grouped(kept));
  }
  return is_whole ? kExitOk : kExitFailure;
}

}  // namespace

std::vector<archive::Manifest> InCodings(const std::vector<archive::Manifest>& manifests,
                                         const std::vector<tiler::Coding>& codings) {
  std::vector<archive::Manifest> all;
  for (const archive::Manifest& manifest : manifests) {
    const bool is_compressed = manifest.kind.coding != tiler::Coding::kIdentity;
    for (const tiler::Coding coding : is_compressed ? codings : std::vector{tiler::Coding::kIdentity}) {
      all.push_back(manifest);
      all.back().kind.coding = coding;
    }
  }
  return all;
}

int SeedCache(const BakeArguments& arguments, const config::DiskCacheConfig& limits,
              const tiler::TilePipeline& pipeline, std::vector<bake::Target> targets, const bake::Shard& shard,
              const StopSignals& signals) {
  Seed seed(pipeline.datasets().front());
  if (const int code = OpenSeed(arguments.into_cache, limits, seed); code != kExitOk) return code;
  for (bake::Target& target : targets) {
    target.create = [&seed, manifest = target.manifest]() -> Result<std::unique_ptr<archive::UnitWriter>> {
      return std::make_unique<SeedWriter>(seed, manifest);
    };
    target.has = [&seed](const tiler::TileRequest& request) {
      return seed.store->Find(seed.KeyOf(request)).has_value();
    };
  }
  const std::stop_callback stop(signals.token(), [&seed] { seed.stop.request_stop(); });
  const bake::UnitPlan plan = bake::UnitPlan::Make(targets, shard);
  bake::Counters counters;
  bake::BakeOptions options;
  options.threads = ThreadsOf(arguments);
  options.stop = seed.stop.get_token();
  std::vector<bake::UnitReport> reports;
  {
    const BakeDisplay display(pipeline.datasets().front().name, plan.tiles, plan.files, counters);
    reports = bake::Bake(pipeline, targets, plan, options, counters);
  }
  seed.store->Flush();
  if (signals.signal() != 0) {
    std::fprintf(stderr,
                 "terrace: stopped after %s tiles, which stay in the cache; run the same command again to go on\n",
                 Grouped(counters.tiles).c_str());
    return 128 + signals.signal();
  }
  return ReportSeed(arguments, limits, seed, plan, reports, counters);
}

}  // namespace terrace::cli

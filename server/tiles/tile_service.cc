#include "server/tiles/tile_service.h"

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "tiler/store/byte_cache.h"

namespace terrace::server {
namespace {

// The tiles of a dataset and level are one kind of jobs (JobTerms). No level is above 63.
std::uint64_t KindOfTile(const tiler::CacheKey& key) {
  return kFirstTileKind + key.generation * 64 + static_cast<std::uint64_t>(key.request.key.level);
}

std::string NameOf(const tiler::TileRequest& request) { return "tile " + geo::ToString(request.key); }

// The generation identifies the dataset, because its index may differ in the next catalog.
tiler::CacheKey KeyOf(const Catalog& catalog, tiler::TileRequest request) {
  const DatasetView& dataset = catalog.datasets[request.dataset];
  const std::uint64_t edits = dataset.edits_hash ? dataset.edits_hash(request) : 0;
  request.dataset = 0;
  return {request, dataset.cache_generation, edits};
}

std::vector<std::uint64_t> GenerationsOf(const Catalog& catalog) {
  std::vector<std::uint64_t> generations;
  for (const DatasetView& dataset : catalog.datasets) generations.push_back(dataset.cache_generation);
  return generations;
}

}  // namespace

TileService::TileService(WorkerPool& workers, TileServiceOptions options, BuildObserver observer)
    : observer_(std::move(observer)),
      tiers_(options.cache_bytes, std::move(options.stores), options.write_header_lines),
      flights_(workers) {}

std::optional<ServedTile> TileService::Find(const Catalog& catalog, const tiler::TileRequest& request) {
  tiler::TilePtr tile = tiers_.memory().Find(KeyOf(catalog, request));
  if (!tile) return std::nullopt;
  hits_.fetch_add(1, std::memory_order_relaxed);
  return ServedTile(std::move(tile), CacheStatus::kHit);
}

asio::awaitable<Result<ServedTile>> TileService::Build(CatalogPtr catalog, tiler::TileRequest request,
                                                       JobClock::time_point deadline, std::uint64_t client) {
  using Flights = decltype(flights_);
  misses_.fetch_add(1, std::memory_order_relaxed);
  const tiler::CacheKey key = KeyOf(*catalog, request);
  Flights::BuildWork find_or_build = [this, catalog = std::move(catalog), request, key,
                                      requested_at = JobClock::now()](const std::stop_token& stop) {
    const std::chrono::microseconds queued = MicrosecondsSince(requested_at);
    bool is_built = false;
    // Looks in memory again: an earlier flight may have ended between Find and the start of this one.
    Result<tiler::TilePtr> tile = tiers_.FindOrBuild(key, [&] {
      is_built = true;
      const Work<tiler::EncodedTile> build = std::bind_front(&tiler::TilePipeline::Build, catalog->pipeline, request);
      Result<tiler::EncodedTile> built = RunWork(NameOf(request), build, stop);
      if (built) built->times.queue = queued;
      return built;
    });
    if (is_built && observer_) observer_(catalog->datasets[request.dataset], tile);
    return tile;
  };
  JobTerms terms;
  terms.client = client;
  terms.level = request.key.level;
  terms.kind = KindOfTile(key);
  terms.deadline = deadline;
  Flights::FlightResult flight = co_await flights_.Join(key, NameOf(request), find_or_build, terms);
  // The flight may be one of the catalog before, whose files were replaced by equal ones: they have the same key.
  const bool is_of_replaced = flight.joined && !flight.value && flight.value.error().code == ErrorCode::kChanged;
  if (is_of_replaced) flight = co_await flights_.Join(key, NameOf(request), std::move(find_or_build), terms);
  if (!flight.value) {
    if (flight.value.error().code == ErrorCode::kOverloaded) refused_.fetch_add(1, std::memory_order_relaxed);
    co_return tl::unexpected(std::move(flight.value.error()));
  }
  // FindOrBuild may have found in memory what an earlier flight had just put there: `found_in` is then that flight's.
  const CacheStatus found = (*flight.value)->found_in != nullptr ? CacheStatus::kStore : CacheStatus::kMiss;
  co_return ServedTile(std::move(*flight.value), flight.joined ? CacheStatus::kJoined : found);
}

void TileService::AlsoRetainTilesOf(const Catalog& catalog) { tiers_.memory().AlsoRetain(GenerationsOf(catalog)); }

void TileService::RetainTilesOf(const Catalog& catalog) {
  bool has_edits = false;
  for (const DatasetView& dataset : catalog.datasets) has_edits |= static_cast<bool>(dataset.edits_hash) || had_edits_;
  tiers_.memory().Retain(GenerationsOf(catalog));
  // In datasets that stay: erases the tiles whose edits have changed.
  if (has_edits) {
    tiers_.memory().EraseIf([&](const tiler::CacheKey& key) {
      return std::ranges::none_of(catalog.datasets, [&](const DatasetView& dataset) {
        return dataset.cache_generation == key.generation &&
               key.edits == (dataset.edits_hash ? dataset.edits_hash(key.request) : 0);
      });
    });
  }
  had_edits_ = std::ranges::any_of(catalog.datasets,
                                   [](const DatasetView& dataset) { return static_cast<bool>(dataset.edits_hash); });
}

void TileService::SetCacheBytes(std::size_t capacity) { tiers_.memory().SetCapacity(capacity); }

TileService::Stats TileService::stats() const {
  Stats stats;
  stats.hits = hits_.load(std::memory_order_relaxed);
  stats.misses = misses_.load(std::memory_order_relaxed);
  stats.joined = flights_.joined_total();
  stats.refused = refused_.load(std::memory_order_relaxed);
  stats.store_times = tiers_.store_times();
  stats.in_flight = flights_.in_flight();
  stats.cache = tiers_.memory().stats();
  stats.cache.hits = stats.hits;
  stats.cache.misses = stats.misses;
  return stats;
}

}  // namespace terrace::server

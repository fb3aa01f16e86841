#include "server/tiles/tile_service.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"

namespace terrace::server {
namespace {

using Clock = TileService::Clock;

constexpr int kAfterTiles = 40;  // deeper than any

// Kinds of jobs (JobOrder): tiles of a dataset and level, and work for one request.
std::uint64_t KindOfTile(const tiler::CacheKey& key) {
  return key.generation * 64 + static_cast<std::uint64_t>(key.request.key.level);
}
constexpr std::uint64_t kShortKind = 62, kLongKind = 63;  // no level

std::string NameOf(const tiler::TileRequest& request) { return "tile " + geo::ToString(request.key); }

// The generation identifies the dataset, because its index may differ in the next catalog.
tiler::CacheKey KeyOf(const Catalog& catalog, tiler::TileRequest request) {
  const DatasetView& dataset = catalog.datasets[request.dataset];
  const std::uint64_t edits = dataset.edits_of ? dataset.edits_of(request) : 0;
  request.dataset = 0;
  return {request, dataset.cache_generation(), edits};
}

}  // namespace

TileService::TileService(TileServiceOptions options, BuildObserver observer)
    : observer_(std::move(observer)),
      write_head_(options.write_head),
      cache_(options.cache_bytes),
      stores_(std::move(options.stores)),
      pool_(options.worker_threads, options.queue_length),
      flights_(pool_),
      store_times_(stores_.size()) {}

TileService::~TileService() { Shutdown(); }

std::optional<ServedTile> TileService::Find(const Catalog& catalog, const tiler::TileRequest& request) {
  tiler::TilePtr tile = cache_.Find(KeyOf(catalog, request));
  if (!tile) return std::nullopt;
  hits_.fetch_add(1, std::memory_order_relaxed);
  return ServedTile(std::move(tile), CacheStatus::kHit);
}

asio::awaitable<Result<ServedTile>> TileService::Build(CatalogPtr catalog, tiler::TileRequest request,
                                                       Clock::time_point deadline, std::uint64_t client) {
  using Flights = decltype(flights_);
  const tiler::CacheKey key = KeyOf(*catalog, request);
  Flights::Build build = [this, catalog = std::move(catalog), request, key,
                          requested_at = Clock::now()](std::stop_token stop) {
    return BuildAndKeep(*catalog, request, key, requested_at, std::move(stop));
  };
  JobOrder order;
  order.client = client;
  order.level = request.key.level;
  order.kind = KindOfTile(key);
  order.deadline = deadline;
  Flights::FlightResult flight = co_await flights_.Join(key, NameOf(request), std::move(build), order);
  if (!flight.joined) misses_.fetch_add(1, std::memory_order_relaxed);
  if (!flight.value) {
    if (flight.value.error().code == ErrorCode::kOverloaded) refused_.fetch_add(1, std::memory_order_relaxed);
    co_return tl::unexpected(std::move(flight.value.error()));
  }
  const CacheStatus found = (*flight.value)->store != nullptr ? CacheStatus::kStore : CacheStatus::kMiss;
  co_return ServedTile(std::move(*flight.value), flight.joined ? CacheStatus::kJoined : found);
}

// The tile as it is cached and sent.
tiler::TilePtr TileService::Finish(const tiler::TileRequest& request, tiler::EncodedTile tile) const {
  if (write_head_ != nullptr) tile.head = write_head_(request, tile);
  return std::make_shared<const tiler::EncodedTile>(std::move(tile));
}

Result<tiler::TilePtr> TileService::BuildAndKeep(const Catalog& catalog, const tiler::TileRequest& request,
                                                 const tiler::CacheKey& key, Clock::time_point requested_at,
                                                 std::stop_token stop) {
  const std::chrono::microseconds queued = MicrosecondsSince(requested_at);
  // An earlier flight may have ended between the look-up in the cache and the start of this one.
  if (tiler::TilePtr tile = cache_.Find(key)) return tile;
  for (auto store = stores_.begin(); store != stores_.end(); ++store) {
    const auto begun = Clock::now();
    std::optional<tiler::EncodedTile> kept = (*store)->Find(key);
    store_times_[static_cast<std::size_t>(store - stores_.begin())].fetch_add(MicrosecondsSince(begun).count(),
                                                                              std::memory_order_relaxed);
    if (!kept) continue;
    kept->store = (*store)->name();
    tiler::TilePtr tile = Finish(request, *std::move(kept));
    cache_.Insert(key, tile);
    for (auto above = stores_.begin(); above != store; ++above) (*above)->Insert(key, tile);
    return tile;
  }
  const Work<tiler::EncodedTile> work = [&](std::stop_token token) {
    return catalog.pipeline->Build(request, std::move(token));
  };
  Result<tiler::EncodedTile> built = Outcome(NameOf(request), work, std::move(stop));
  Result<tiler::TilePtr> tile;
  if (built) {
    built->times.queue = queued;
    tile = Finish(request, *std::move(built));
    cache_.Insert(key, *tile);
    for (const auto& store : stores_) store->Insert(key, *tile);
  } else {
    for (const auto& store : stores_) store->GiveUp(key);
    tile = tl::unexpected(std::move(built.error()));
  }
  if (observer_) observer_(catalog.datasets[request.dataset], tile);
  return tile;
}

JobOrder TileService::OrderOf(Length length, Clock::time_point deadline, std::uint64_t client) {
  JobOrder order;
  order.client = client;
  order.is_long = length == Length::kLong;
  order.level = order.is_long ? kAfterTiles : 0;
  order.kind = order.is_long ? kLongKind : kShortKind;
  order.deadline = deadline;
  return order;
}

void TileService::RetainTilesOf(const Catalog& catalog) {
  std::vector<std::uint64_t> generations;
  bool has_edits = false;
  for (const DatasetView& dataset : catalog.datasets) {
    generations.push_back(dataset.cache_generation());
    has_edits |= static_cast<bool>(dataset.edits_of) || had_edits_;
  }
  cache_.Retain(generations);
  // In datasets that stay: erases the tiles whose edits have changed.
  if (has_edits) {
    cache_.EraseIf([&](const tiler::CacheKey& key) {
      return std::ranges::none_of(catalog.datasets, [&](const DatasetView& dataset) {
        return dataset.cache_generation() == key.generation &&
               key.edits == (dataset.edits_of ? dataset.edits_of(key.request) : 0);
      });
    });
  }
  had_edits_ = std::ranges::any_of(catalog.datasets,
                                   [](const DatasetView& dataset) { return static_cast<bool>(dataset.edits_of); });
}

// The slowest tier first and memory last: a tile that is found in a tier meanwhile goes into the tiers above it.
Result<TileService::Erased> TileService::Erase(const tiler::TileSelection& selection, const std::stop_token& stop) {
  Erased erased;
  Result<void> done;
  for (auto store = stores_.rbegin(); store != stores_.rend(); ++store) {
    Result<std::size_t> of_store = (*store)->Erase(selection, stop);
    if (of_store) {
      erased.stores.emplace_back((*store)->name(), *of_store);
    } else {
      done = tl::unexpected(std::move(of_store.error()));
    }
  }
  erased.memory = cache_.EraseIf([&](const tiler::CacheKey& key) { return IsSelected(selection, key); });
  if (!done) return tl::unexpected(std::move(done.error()));
  return erased;
}

TileService::Stats TileService::stats() const {
  Stats stats;
  stats.hits = hits_.load(std::memory_order_relaxed);
  stats.misses = misses_.load(std::memory_order_relaxed);
  stats.joined = flights_.joined_total();
  stats.refused = refused_.load(std::memory_order_relaxed);
  for (const auto& time : store_times_) stats.store_times.emplace_back(time.load(std::memory_order_relaxed));
  stats.queued = pool_.queued();
  stats.in_flight = flights_.in_flight() + pool_.runs();
  stats.cache = cache_.stats();
  stats.cache.hits = stats.hits;
  stats.cache.misses = stats.misses;
  return stats;
}

}  // namespace terrace::server

#include "server/tiles/tile_service.h"

#include <exception>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/tiles/tile_head.h"

namespace terrace::server {
namespace {

using Clock = TileService::Clock;

constexpr int kAfterTiles = 40;  // deeper than any

// Of jobs (JobOrder): tiles of a dataset and level, and work for one request.
std::uint64_t KindOfTile(const tiler::CacheKey& key) {
  return key.generation * 64 + static_cast<std::uint64_t>(key.request.key.level);
}
constexpr std::uint64_t kShortKind = 62, kLongKind = 63;  // no level

Result<tiler::EncodedTile> RunWork(const SingleFlight::Work& work, const std::string& what, Clock::time_point asked,
                                   std::stop_token stop) {
  const auto queued = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - asked);
  try {
    Result<tiler::EncodedTile> built = work(std::move(stop));
    if (built) built->times.queue = queued;
    return built;
  } catch (const std::exception& exception) {  // std::bad_alloc above all
    return MakeError(ErrorCode::kUnavailable, "{}: {}", what, exception.what());
  }
}

// What is cached and sent.
tiler::TilePtr Finish(const tiler::TileRequest& request, tiler::EncodedTile tile) {
  tile.head = MakeTileHead(request, tile);
  return std::make_shared<const tiler::EncodedTile>(std::move(tile));
}

// The generation stands for the dataset, whose index may be another one in the next catalog.
tiler::CacheKey KeyOf(const Catalog& catalog, tiler::TileRequest request) {
  const std::uint64_t generation = catalog.datasets[request.dataset].generation;
  request.dataset = 0;
  return {request, generation};
}

}  // namespace

TileService::TileService(TileServiceOptions options, BuildObserver observer)
    : observer_(std::move(observer)),
      cache_(options.cache_bytes),
      disk_(std::move(options.disk)),
      pool_(options.worker_threads, options.queue_length),
      flights_(pool_) {}

TileService::~TileService() { Shutdown(); }

std::optional<ServedTile> TileService::Find(const Catalog& catalog, const tiler::TileRequest& request) {
  tiler::TilePtr tile = cache_.Find(KeyOf(catalog, request));
  if (!tile) return std::nullopt;
  hits_.fetch_add(1, std::memory_order_relaxed);
  return ServedTile(std::move(tile), CacheStatus::kHit);
}

asio::awaitable<Result<ServedTile>> TileService::Get(CatalogPtr catalog, tiler::TileRequest request,
                                                     Clock::time_point deadline, std::uint64_t client) {
  if (std::optional<ServedTile> found = Find(*catalog, request)) co_return *std::move(found);
  const tiler::CacheKey key = KeyOf(*catalog, request);
  SingleFlight::Build build = [this, catalog = std::move(catalog), request, key,
                               asked = Clock::now()](std::stop_token stop) {
    return BuildAndKeep(*catalog, request, key, asked, std::move(stop));
  };
  JobOrder order;
  order.client = client;
  order.level = request.key.level;
  order.kind = KindOfTile(key);
  SingleFlight::Landing landing = co_await flights_.Join(key, std::move(build), deadline, order);
  if (!landing.joined) misses_.fetch_add(1, std::memory_order_relaxed);
  if (!landing.tile) co_return tl::unexpected(std::move(landing.tile.error()));
  const CacheStatus found = (*landing.tile)->from_disk ? CacheStatus::kDisk : CacheStatus::kMiss;
  co_return ServedTile(std::move(*landing.tile), landing.joined ? CacheStatus::kJoined : found);
}

Result<tiler::TilePtr> TileService::BuildAndKeep(const Catalog& catalog, const tiler::TileRequest& request,
                                                 const tiler::CacheKey& key, Clock::time_point asked,
                                                 std::stop_token stop) {
  // Between the look into the cache and the start of this flight an earlier flight may have landed.
  if (tiler::TilePtr tile = cache_.Find(key)) return tile;
  tiler::TileStore* const disk = disk_ ? disk_->tiles() : nullptr;
  if (const tiler::TilePtr kept = disk != nullptr ? disk->Find(key) : nullptr) {
    tiler::EncodedTile copy = *kept;
    copy.from_disk = true;
    tiler::TilePtr tile = Finish(request, std::move(copy));
    cache_.Insert(key, tile);
    return tile;
  }
  const SingleFlight::Work work = [&](std::stop_token token) { return catalog.build(request, std::move(token)); };
  Result<tiler::EncodedTile> built = RunWork(work, "tile " + geo::ToString(request.key), asked, std::move(stop));
  Result<tiler::TilePtr> tile;
  if (built) {
    tile = Finish(request, *std::move(built));
    cache_.Insert(key, *tile);
    if (disk != nullptr) disk->Insert(key, *tile);
  } else {
    tile = tl::unexpected(std::move(built.error()));
  }
  if (observer_) observer_(catalog.datasets[request.dataset], tile);
  return tile;
}

asio::awaitable<Result<tiler::TilePtr>> TileService::Run(SingleFlight::Work work, Length length,
                                                         Clock::time_point deadline, std::uint64_t client) {
  tiler::CacheKey key;
  key.solo = 1 + solos_.fetch_add(1, std::memory_order_relaxed);
  SingleFlight::Build build = [work = std::move(work),
                               asked = Clock::now()](std::stop_token stop) -> Result<tiler::TilePtr> {
    Result<tiler::EncodedTile> made = RunWork(work, "work for one request", asked, std::move(stop));
    if (!made) return tl::unexpected(std::move(made.error()));
    return std::make_shared<const tiler::EncodedTile>(*std::move(made));
  };
  JobOrder order;
  order.client = client;
  order.is_long = length == Length::kLong;
  order.level = order.is_long ? kAfterTiles : 0;
  order.kind = order.is_long ? kLongKind : kShortKind;
  SingleFlight::Landing landing = co_await flights_.Join(key, std::move(build), deadline, order);
  co_return std::move(landing.tile);
}

void TileService::RetainTilesOf(const Catalog& catalog) {
  std::vector<std::uint64_t> generations;
  for (const DatasetView& dataset : catalog.datasets) generations.push_back(dataset.generation);
  cache_.Retain(generations);
}

void TileService::CancelBuilds() { flights_.Shutdown(); }

void TileService::Shutdown() {
  flights_.Shutdown();
  pool_.Shutdown();
}

TileService::Stats TileService::stats() const {
  Stats stats;
  stats.hits = hits_.load(std::memory_order_relaxed);
  stats.misses = misses_.load(std::memory_order_relaxed);
  stats.joined = flights_.joined_total();
  stats.queued = pool_.queued();
  stats.in_flight = flights_.in_flight();
  stats.cache = cache_.stats();
  stats.cache.hits = stats.hits;
  stats.cache.misses = stats.misses;
  if (disk_) stats.disk = disk_->stats();
  return stats;
}

}  // namespace terrace::server

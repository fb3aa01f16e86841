#include "server/tiles/tile_service.h"

#include <exception>
#include <memory>
#include <utility>

namespace terrace::server {
namespace {

Result<TilePtr> RunBuilder(const TileBuilder& builder, const TileRequest& request, std::stop_token stop) {
  try {
    Result<EncodedTile> built = builder(request, std::move(stop));
    if (!built) return tl::unexpected(std::move(built.error()));
    return std::make_shared<const EncodedTile>(std::move(*built));
  } catch (const std::exception& exception) {  // std::bad_alloc above all
    return MakeError(ErrorCode::kUnavailable, "tile {}: {}", geo::ToString(request.key), exception.what());
  }
}

}  // namespace

TileService::TileService(TileServiceOptions options, TileBuilder builder, BuildObserver observer)
    : builder_(std::move(builder)),
      observer_(std::move(observer)),
      cache_(options.cache_bytes),
      pool_(options.worker_threads, options.queue_length),
      flights_(pool_) {}

TileService::~TileService() { Shutdown(); }

asio::awaitable<Result<ServedTile>> TileService::Get(CacheKey key, Clock::time_point deadline) {
  if (TilePtr tile = cache_.Find(key)) {
    hits_.fetch_add(1, std::memory_order_relaxed);
    co_return ServedTile(std::move(tile), CacheStatus::kHit);
  }
  SingleFlight::Build build = [this, key](std::stop_token stop) { return BuildAndKeep(key, std::move(stop)); };
  SingleFlight::Landing landing = co_await flights_.Join(key, std::move(build), deadline);
  if (!landing.joined) misses_.fetch_add(1, std::memory_order_relaxed);
  if (!landing.tile) co_return tl::unexpected(std::move(landing.tile.error()));
  co_return ServedTile(std::move(*landing.tile), landing.joined ? CacheStatus::kJoined : CacheStatus::kMiss);
}

Result<TilePtr> TileService::BuildAndKeep(const CacheKey& key, std::stop_token stop) {
  // Between the look into the cache and the start of this flight an earlier flight may have landed.
  if (TilePtr tile = cache_.Find(key)) return tile;
  Result<TilePtr> tile = RunBuilder(builder_, key.request, std::move(stop));
  if (tile) cache_.Insert(key, *tile);
  if (observer_) observer_(key.request, tile);
  return tile;
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
  return stats;
}

}  // namespace terrace::server

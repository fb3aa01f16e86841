#include "server/tiles/tile_service.h"

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_future.hpp>
#include <future>
#include <new>
#include <optional>
#include <thread>

namespace terrace::server {
namespace {

Result<ServedTile> Get(TileService& service, CacheKey key = {}) {
  asio::io_context io(1);
  auto got =
      asio::co_spawn(io, service.Get(key, TileService::Clock::now() + std::chrono::seconds(10)), asio::use_future);
  io.run();
  return got.get();
}

TEST(TileService, BuildsOnceAndThenHits) {
  std::atomic<int> builds{0};
  TileService service({}, [&](const TileRequest&, std::stop_token) -> Result<EncodedTile> {
    ++builds;
    return EncodedTile();
  });
  EXPECT_EQ(Get(service)->cache, CacheStatus::kMiss);
  EXPECT_EQ(Get(service)->cache, CacheStatus::kHit);
  EXPECT_EQ(builds, 1);
  EXPECT_EQ(service.stats().hits, 1u);
  EXPECT_EQ(service.stats().misses, 1u);
}

TEST(TileService, FindsWhatIsCachedAndBuildsNothing) {
  std::atomic<int> builds{0};
  TileService service({}, [&](const TileRequest&, std::stop_token) -> Result<EncodedTile> {
    ++builds;
    return EncodedTile();
  });
  EXPECT_FALSE(service.Find({}));
  EXPECT_EQ(builds, 0);
  ASSERT_TRUE(Get(service));
  const std::optional<ServedTile> found = service.Find({});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->cache, CacheStatus::kHit);
  EXPECT_EQ(builds, 1);
  EXPECT_EQ(service.stats().hits, 1u);
  EXPECT_EQ(service.stats().misses, 1u);
}

TEST(TileService, KeepsNoFailure) {
  std::atomic<int> builds{0};
  TileService service({}, [&](const TileRequest&, std::stop_token) -> Result<EncodedTile> {
    if (++builds == 1) return MakeError(ErrorCode::kUnavailable, "gone");
    return EncodedTile();
  });
  EXPECT_EQ(Get(service).error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(Get(service));
}

TEST(TileService, TurnsExceptionsIntoUnavailable) {
  TileService service({}, [](const TileRequest&, std::stop_token) -> Result<EncodedTile> { throw std::bad_alloc(); });
  EXPECT_EQ(Get(service).error().code, ErrorCode::kUnavailable);
}

TEST(TileService, BuildsAgainForAnotherGeneration) {
  std::atomic<int> builds{0};
  TileService service({}, [&](const TileRequest&, std::stop_token) -> Result<EncodedTile> {
    ++builds;
    return EncodedTile();
  });
  CacheKey key;
  ASSERT_TRUE(Get(service, key));
  key.generation = 2;
  ASSERT_TRUE(Get(service, key));
  EXPECT_EQ(builds, 2);
}

TEST(TileService, TellsTheObserverAboutEveryBuild) {
  std::atomic<int> good{0}, bad{0};
  TileService service(
      {},
      [](const TileRequest& request, std::stop_token) -> Result<EncodedTile> {
        if (request.dataset == 1) return MakeError(ErrorCode::kInternal, "no");
        return EncodedTile();
      },
      [&](const TileRequest&, const Result<TilePtr>& tile) { ++(tile ? good : bad); });
  CacheKey key;
  ASSERT_TRUE(Get(service, key));
  ASSERT_TRUE(Get(service, key));
  key.request.dataset = 1;
  ASSERT_FALSE(Get(service, key));
  EXPECT_EQ(good, 1);
  EXPECT_EQ(bad, 1);
}

Result<TilePtr> RunAlone(TileService& service, SingleFlight::Work work, TileService::Length length) {
  asio::io_context io(1);
  auto ran = asio::co_spawn(
      io, service.Run(std::move(work), length, TileService::Clock::now() + std::chrono::seconds(10)), asio::use_future);
  io.run();
  return ran.get();
}

TEST(TileService, KeepsAWorkerForTilesBesideLongWork) {
  TileServiceOptions options;
  options.worker_threads = 2;
  TileService service(options,
                      [](const TileRequest&, std::stop_token) -> Result<EncodedTile> { return EncodedTile(); });
  std::promise<void> begun, end;
  const SingleFlight::Work work = [&](std::stop_token) -> Result<EncodedTile> {
    begun.set_value();
    end.get_future().wait();
    return EncodedTile();
  };
  const SingleFlight::Work nothing = [](std::stop_token) -> Result<EncodedTile> { return EncodedTile(); };
  auto first = std::async(std::launch::async, [&] { return RunAlone(service, work, TileService::Length::kLong); });
  begun.get_future().wait();
  const Result<TilePtr> second = RunAlone(service, nothing, TileService::Length::kLong);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kOverloaded);
  EXPECT_TRUE(Get(service));
  EXPECT_TRUE(RunAlone(service, nothing, TileService::Length::kShort));
  end.set_value();
  EXPECT_TRUE(first.get());
  // The first one's turn ends with its job, a moment after its answer.
  while (!RunAlone(service, nothing, TileService::Length::kLong)) std::this_thread::yield();
}

}  // namespace
}  // namespace terrace::server

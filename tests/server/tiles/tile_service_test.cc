#include "server/tiles/tile_service.h"

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/use_future.hpp>
#include <future>
#include <new>
#include <optional>
#include <thread>
#include <unordered_map>
#include <utility>
#include <vector>

#include "tests/server/fake_pipeline.h"

namespace terrace::server {
namespace {

// One dataset of generation 1.
std::shared_ptr<Catalog> CatalogOf(TileBuilder builder) {
  auto catalog = std::make_shared<Catalog>();
  catalog->datasets.resize(1);
  catalog->datasets[0].generation = catalog->datasets[0].cache_generation = 1;
  catalog->pipeline = std::make_shared<FakePipeline>(std::move(builder));
  return catalog;
}

Result<tiler::EncodedTile> BuildEmpty(const tiler::TileRequest&, std::stop_token) { return tiler::EncodedTile(); }

// A service with workers of its own.
struct TestService {
  explicit TestService(TileServiceOptions options = {}, BuildObserver observer = nullptr)
      : workers(2, 100), tiles(workers, std::move(options), std::move(observer)) {}
  ~TestService() { workers.Shutdown(); }

  WorkerPool workers;
  TileService tiles;
};

Result<ServedTile> Get(TestService& service, CatalogPtr catalog, tiler::TileRequest request = {}) {
  asio::io_context io(1);
  const auto deadline = JobClock::now() + std::chrono::seconds(10);
  if (std::optional<ServedTile> found = service.tiles.Find(*catalog, request)) return *std::move(found);
  auto got = asio::co_spawn(io, service.tiles.Build(std::move(catalog), request, deadline), asio::use_future);
  io.run();
  return got.get();
}

TEST(TileService, BuildsOnceAndThenFindsWhatIsCached) {
  std::atomic<int> builds{0};
  TestService service;
  const CatalogPtr catalog = CatalogOf([&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    ++builds;
    return tiler::EncodedTile();
  });
  EXPECT_FALSE(service.tiles.Find(*catalog, {}));
  EXPECT_EQ(builds, 0);
  EXPECT_EQ(Get(service, catalog)->cache, CacheStatus::kMiss);
  EXPECT_EQ(Get(service, catalog)->cache, CacheStatus::kHit);
  const std::optional<ServedTile> found = service.tiles.Find(*catalog, {});
  ASSERT_TRUE(found);
  EXPECT_EQ(found->cache, CacheStatus::kHit);
  EXPECT_EQ(builds, 1);
  EXPECT_EQ(service.tiles.stats().hits, 2u);
  EXPECT_EQ(service.tiles.stats().misses, 1u);
}

// Each has looked in memory in vain: hits and misses together are all requests.
TEST(TileService, CountsAMissForEachRequestThatWaitsForABuild) {
  TestService service;
  std::promise<void> all_wait;
  const CatalogPtr catalog = CatalogOf([&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    all_wait.get_future().wait();
    return tiler::EncodedTile();
  });
  asio::io_context io(1);
  const auto deadline = JobClock::now() + std::chrono::seconds(10);
  std::vector<std::future<Result<ServedTile>>> waiting;
  for (int i = 0; i < 3; ++i) {
    waiting.push_back(asio::co_spawn(io, service.tiles.Build(catalog, {}, deadline), asio::use_future));
  }
  while (service.tiles.stats().joined < 2) io.run_one();
  all_wait.set_value();
  io.run();
  for (auto& tile : waiting) EXPECT_TRUE(tile.get());
  EXPECT_EQ(service.tiles.stats().misses, 3u);
}

// A tier in memory.
class FakeStore final : public tiler::TileStore {
 public:
  explicit FakeStore(const char* name) : name_(name) {}

  const char* name() const override { return name_; }
  tiler::StoreStats stats() const override { return {}; }
  Result<std::size_t> Erase(const tiler::TileSelection&, const std::stop_token&) override { return std::size_t{0}; }
  void Abandon() override {}
  std::optional<tiler::EncodedTile> Find(const tiler::CacheKey& key) override {
    const auto kept = kept_.find(key);
    return kept == kept_.end() ? std::nullopt : std::optional(*kept->second);
  }
  void Insert(const tiler::CacheKey& key, tiler::TilePtr tile) override { kept_[key] = std::move(tile); }

  std::size_t size() const { return kept_.size(); }
  void Clear() { kept_.clear(); }

 private:
  const char* name_;
  std::unordered_map<tiler::CacheKey, tiler::TilePtr, tiler::CacheKeyHash> kept_;
};

TEST(TileService, AsksTiersInOrderAndFillsThoseAbove) {
  const auto first = std::make_shared<FakeStore>("first"), second = std::make_shared<FakeStore>("second");
  TileServiceOptions options;
  options.cache_bytes = 0;
  options.stores = {first, second};
  TestService service(std::move(options));
  const CatalogPtr catalog = CatalogOf(BuildEmpty);
  EXPECT_EQ(Get(service, catalog)->cache, CacheStatus::kMiss);
  EXPECT_EQ(first->size(), 1u);
  EXPECT_EQ(second->size(), 1u);
  EXPECT_STREQ(Get(service, catalog)->tile->found_in, "first");
  first->Clear();
  EXPECT_STREQ(Get(service, catalog)->tile->found_in, "second");
  EXPECT_STREQ(Get(service, catalog)->tile->found_in, "first");
}

TEST(TileService, KeepsNoFailure) {
  std::atomic<int> builds{0};
  TestService service;
  const CatalogPtr catalog = CatalogOf([&](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> {
    if (++builds == 1) return MakeError(ErrorCode::kUnavailable, "gone");
    return tiler::EncodedTile();
  });
  EXPECT_EQ(Get(service, catalog).error().code, ErrorCode::kUnavailable);
  EXPECT_TRUE(Get(service, catalog));
}

TEST(TileService, AShortageOfMemoryIsNoFaultOfTheSource) {
  TestService service;
  const CatalogPtr catalog = CatalogOf(
      [](const tiler::TileRequest&, std::stop_token) -> Result<tiler::EncodedTile> { throw std::bad_alloc(); });
  EXPECT_EQ(Get(service, catalog).error().code, ErrorCode::kOverloaded);
}

TEST(TileService, FindsTilesOfAGenerationInLaterCatalogs) {
  TestService service;
  const auto first = CatalogOf(BuildEmpty);
  ASSERT_TRUE(Get(service, first));
  const auto shifted = CatalogOf(BuildEmpty);
  shifted->datasets.insert(shifted->datasets.begin(), DatasetView());
  shifted->datasets[0].cache_generation = 7;
  tiler::TileRequest request;
  EXPECT_EQ(Get(service, shifted, request)->cache, CacheStatus::kMiss) << "another dataset has the index now";
  request.dataset = 1;
  EXPECT_EQ(Get(service, shifted, request)->cache, CacheStatus::kHit);
}

TEST(TileService, BuildsAgainForAnotherGeneration) {
  TestService service;
  ASSERT_TRUE(Get(service, CatalogOf(BuildEmpty)));
  const auto changed = CatalogOf(BuildEmpty);
  changed->datasets[0].cache_generation = 2;
  EXPECT_EQ(Get(service, changed)->cache, CacheStatus::kMiss);
}

TEST(TileService, ForgetsGenerationsThatAreGone) {
  TestService service;
  const auto old = CatalogOf(BuildEmpty), next = CatalogOf(BuildEmpty);
  next->datasets[0].cache_generation = 2;
  ASSERT_TRUE(Get(service, old));
  ASSERT_TRUE(Get(service, next));
  service.tiles.RetainTilesOf(*next);
  EXPECT_EQ(service.tiles.stats().cache.entries, 1u);
  EXPECT_EQ(Get(service, next)->cache, CacheStatus::kHit);
  EXPECT_EQ(Get(service, old)->cache, CacheStatus::kMiss) << "still answered";
  EXPECT_EQ(service.tiles.stats().cache.entries, 1u) << "but not kept";
}

TEST(TileService, KeepsTheTilesOfACatalogThatIsAboutToBeServed) {
  TestService service;
  const auto old = CatalogOf(BuildEmpty), next = CatalogOf(BuildEmpty);
  next->datasets[0].cache_generation = 2;
  service.tiles.RetainTilesOf(*old);
  service.tiles.AlsoRetainTilesOf(*next);
  ASSERT_TRUE(Get(service, old));
  ASSERT_TRUE(Get(service, next));
  EXPECT_EQ(service.tiles.stats().cache.entries, 2u);
  service.tiles.RetainTilesOf(*next);
  EXPECT_EQ(Get(service, next)->cache, CacheStatus::kHit);
}

// Other edits are another generation, but the tiles that none of them touches have their old keys.
TEST(TileService, KeepsTheTilesThatChangedEditsDoNotTouch) {
  TestService service;
  const auto with_edits = [](std::uint64_t generation, std::uint64_t of_touched) {
    const auto catalog = CatalogOf(BuildEmpty);
    catalog->datasets[0].generation = generation;
    catalog->datasets[0].cache_generation = 1;
    catalog->datasets[0].edits_hash = [of_touched](const tiler::TileRequest& request) {
      return request.key.x == 1 ? of_touched : std::uint64_t{0};
    };
    return catalog;
  };
  const auto unedited = CatalogOf(BuildEmpty), old = with_edits(2, 20), next = with_edits(3, 30);
  tiler::TileRequest touched, untouched;
  touched.key = {0, 1, 0};
  untouched.key = {0, 0, 0};
  for (const auto& catalog : {unedited, old, next}) service.tiles.RetainTilesOf(*catalog);
  service.tiles.RetainTilesOf(*old);
  EXPECT_EQ(Get(service, unedited, touched)->cache, CacheStatus::kMiss);
  EXPECT_EQ(Get(service, old, touched)->cache, CacheStatus::kMiss);
  EXPECT_EQ(Get(service, unedited, untouched)->cache, CacheStatus::kMiss);
  EXPECT_EQ(Get(service, old, untouched)->cache, CacheStatus::kHit);
  service.tiles.RetainTilesOf(*next);
  EXPECT_EQ(service.tiles.stats().cache.entries, 1u) << "two had edits that the new catalog does not have";
  EXPECT_EQ(Get(service, next, touched)->cache, CacheStatus::kMiss);
  EXPECT_EQ(Get(service, next, untouched)->cache, CacheStatus::kHit);
  service.tiles.RetainTilesOf(*unedited);
  EXPECT_EQ(service.tiles.stats().cache.entries, 1u);
  EXPECT_EQ(Get(service, unedited, untouched)->cache, CacheStatus::kHit);
}

TEST(TileService, TellsTheObserverAboutEveryBuild) {
  std::atomic<int> good{0}, bad{0};
  TestService service({}, [&](const DatasetView& dataset, const Result<tiler::TilePtr>& tile) {
    EXPECT_EQ(dataset.generation, 1u);
    ++(tile ? good : bad);
  });
  const CatalogPtr catalog =
      CatalogOf([](const tiler::TileRequest& request, std::stop_token) -> Result<tiler::EncodedTile> {
        if (request.key.x == 1) return MakeError(ErrorCode::kInternal, "no");
        return tiler::EncodedTile();
      });
  tiler::TileRequest request;
  ASSERT_TRUE(Get(service, catalog, request));
  ASSERT_TRUE(Get(service, catalog, request));
  request.key.x = 1;
  ASSERT_FALSE(Get(service, catalog, request));
  EXPECT_EQ(good, 1);
  EXPECT_EQ(bad, 1);
}

Result<int> RunAlone(TestService& service, Work<int> work,
                     JobTerms (*terms)(JobClock::time_point deadline, std::uint64_t client)) {
  asio::io_context io(1);
  auto ran = asio::co_spawn(
      io, service.workers.Run(std::move(work), terms(JobClock::now() + std::chrono::seconds(10), /*client=*/0)),
      asio::use_future);
  io.run();
  return ran.get();
}

TEST(TileService, KeepsAWorkerForTilesBesideLongWork) {
  TestService service;
  std::promise<void> begun, end;
  const Work<int> work = [&](std::stop_token) -> Result<int> {
    begun.set_value();
    end.get_future().wait();
    return 1;
  };
  const Work<int> nothing = [](std::stop_token) -> Result<int> { return 0; };
  auto first = std::async(std::launch::async, [&] { return RunAlone(service, work, LongTerms); });
  begun.get_future().wait();
  auto second = std::async(std::launch::async, [&] { return RunAlone(service, nothing, LongTerms); });
  while (service.workers.queued() == 0) std::this_thread::yield();
  EXPECT_TRUE(Get(service, CatalogOf(BuildEmpty)));
  EXPECT_TRUE(RunAlone(service, nothing, ShortTerms));
  EXPECT_EQ(service.workers.queued(), 1u) << "it waits, and nobody waits for it";
  end.set_value();
  EXPECT_TRUE(first.get());
  EXPECT_TRUE(second.get());
}

}  // namespace
}  // namespace terrace::server

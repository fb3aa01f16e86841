#include "tiler/store/tile_tiers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <thread>
#include <unordered_map>

#include "tiler/store/byte_cache.h"

namespace terrace::tiler {
namespace {

using Calls = std::vector<std::string>;

// A tier in memory that records its calls as "name.call".
class FakeStore final : public TileStore {
 public:
  FakeStore(const char* name, Calls& calls) : name_(name), calls_(calls) {}

  const char* name() const override { return name_; }
  StoreStats stats() const override { return {}; }
  void Abandon() override {}
  Result<std::size_t> Erase(const TileSelection&, const std::stop_token&) override {
    Record("Erase");
    if (is_broken) return MakeError(ErrorCode::kUnavailable, "{} is broken", name_);
    const std::size_t erased = kept_.size();
    kept_.clear();
    return erased;
  }
  std::optional<EncodedTile> Find(const CacheKey& key) override {
    Record("Find");
    std::this_thread::sleep_for(delay);
    const auto kept = kept_.find(key);
    return kept == kept_.end() ? std::nullopt : std::optional(*kept->second);
  }
  void Insert(const CacheKey& key, TilePtr tile) override {
    Record("Insert");
    kept_[key] = std::move(tile);
  }
  void GiveUp(const CacheKey&) override { Record("GiveUp"); }

  TilePtr Kept(const CacheKey& key) const { return kept_.contains(key) ? kept_.at(key) : nullptr; }

  bool is_broken = false;
  std::chrono::milliseconds delay{0};

 private:
  void Record(const char* call) { calls_.push_back(std::string(name_) + "." + call); }

  const char* name_;
  Calls& calls_;
  std::unordered_map<CacheKey, TilePtr, CacheKeyHash> kept_;
};

CacheKey KeyAt(int x) {
  CacheKey key;
  key.request.key = {3, x, 2};
  key.generation = 1;
  return key;
}

class TileTiersTest : public testing::Test {
 protected:
  // A build that counts as a call and gives a tile with these bytes.
  auto BuildOf(std::string bytes) {
    return [this, bytes = std::move(bytes)]() -> Result<EncodedTile> {
      calls.push_back("build");
      EncodedTile tile;
      tile.bytes = bytes;
      return tile;
    };
  }

  Calls calls;
  const std::shared_ptr<FakeStore> disk = std::make_shared<FakeStore>("disk", calls);
  const std::shared_ptr<FakeStore> shared = std::make_shared<FakeStore>("shared", calls);
};

TEST_F(TileTiersTest, AsksInOrderAndKeepsABuiltTileInAllTiers) {
  TileTiers tiers(1 << 20, {disk, shared});
  const Result<TilePtr> built = tiers.FindOrBuild(KeyAt(1), BuildOf("new"));
  EXPECT_EQ((*built)->bytes, "new");
  EXPECT_EQ((*built)->found_in, nullptr);
  EXPECT_EQ(calls, (Calls{"disk.Find", "shared.Find", "build", "disk.Insert", "shared.Insert"}));
  for (const TilePtr& kept : {tiers.memory().Find(KeyAt(1)), disk->Kept(KeyAt(1)), shared->Kept(KeyAt(1))}) {
    EXPECT_EQ(kept, *built);
  }
  EXPECT_EQ(tiers.memory().Find(KeyAt(2)), nullptr);
}

// Encoders reserve what the format may need at most.
TEST_F(TileTiersTest, KeepsNoMoreMemoryThanItCounts) {
  TileTiers tiers(1 << 20, {});
  const Result<TilePtr> built = tiers.FindOrBuild(KeyAt(1), []() -> Result<EncodedTile> {
    EncodedTile tile;
    tile.bytes.assign(100'000, 'a');
    tile.bytes.resize(500);
    return tile;
  });
  EXPECT_LT((*built)->bytes.capacity(), 600u);
}

TEST_F(TileTiersTest, AsksNobodyForWhatIsInMemory) {
  TileTiers tiers(1 << 20, {disk});
  const Result<TilePtr> built = tiers.FindOrBuild(KeyAt(1), BuildOf("new"));
  calls.clear();
  EXPECT_EQ(*tiers.FindOrBuild(KeyAt(1), BuildOf("newer")), *built);
  EXPECT_EQ(calls, Calls{});
}

TEST_F(TileTiersTest, FillsOnlyTheTiersAboveTheOneThatHasTheTile) {
  const auto archive = std::make_shared<FakeStore>("archive", calls);
  TileTiers tiers(1 << 20, {archive, disk, shared});
  disk->Insert(KeyAt(1), std::make_shared<EncodedTile>());
  calls.clear();
  const Result<TilePtr> found = tiers.FindOrBuild(KeyAt(1), BuildOf("new"));
  EXPECT_STREQ((*found)->found_in, "disk");
  EXPECT_EQ(calls, (Calls{"archive.Find", "disk.Find", "archive.Insert"}));
  EXPECT_EQ(tiers.memory().Find(KeyAt(1)), *found);
}

TEST_F(TileTiersTest, TellsAllStoresThatABuildFailedAndKeepsNothing) {
  TileTiers tiers(1 << 20, {disk, shared});
  const Result<TilePtr> failed = tiers.FindOrBuild(
      KeyAt(1), []() -> Result<EncodedTile> { return MakeError(ErrorCode::kUnavailable, "no such disk"); });
  EXPECT_EQ(failed.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(failed.error().message, "no such disk");
  EXPECT_EQ(calls, (Calls{"disk.Find", "shared.Find", "disk.GiveUp", "shared.GiveUp"}));
  EXPECT_EQ(tiers.memory().stats().entries, 0u);
  EXPECT_TRUE(tiers.FindOrBuild(KeyAt(1), BuildOf("new")));
}

TEST_F(TileTiersTest, WritesTheHeadOfBuiltAndOfFoundTiles) {
  const HeaderWriter write_header_lines = [](const TileRequest& request, const EncodedTile& tile) {
    return HeaderLines{std::to_string(request.key.x) + ": " + tile.bytes, 1};
  };
  for (const char* round : {"built", "found"}) {  // the store outlives the memory
    TileTiers tiers(1 << 20, {disk}, write_header_lines);
    const Result<TilePtr> tile = tiers.FindOrBuild(KeyAt(7), BuildOf("body"));
    EXPECT_EQ((*tile)->header_lines.text, "7: body") << round;
    EXPECT_EQ(tiers.memory().Find(KeyAt(7))->header_lines.bytes_about_body, 1u) << round;
  }
  EXPECT_EQ(std::ranges::count(calls, "build"), 1);
}

TEST_F(TileTiersTest, ErasesTheSlowestFirstAndTheOthersIfOneFails) {
  TileTiers tiers(1 << 20, {disk, shared});
  for (int x = 1; x <= 2; ++x) ASSERT_TRUE(tiers.FindOrBuild(KeyAt(x), BuildOf("new")));
  TileSelection all;
  all.generation = 1;
  shared->is_broken = true;
  calls.clear();
  const Result<TileTiers::Erased> failed = tiers.Erase(all);
  EXPECT_EQ(failed.error().message, "shared is broken");
  EXPECT_EQ(calls, (Calls{"shared.Erase", "disk.Erase"}));
  EXPECT_EQ(disk->Kept(KeyAt(1)), nullptr);
  EXPECT_EQ(tiers.memory().stats().entries, 0u);

  shared->is_broken = false;
  ASSERT_TRUE(tiers.FindOrBuild(KeyAt(1), BuildOf("newer")));  // found in `shared`
  const Result<TileTiers::Erased> erased = tiers.Erase(all);
  EXPECT_EQ(erased->memory, 1u);
  const std::vector<std::pair<const char*, std::size_t>> stores = {{shared->name(), 2}, {disk->name(), 1}};
  EXPECT_EQ(erased->stores, stores);
}

TEST_F(TileTiersTest, AddsUpTheTimeOfLookUpsOfEachStore) {
  TileTiers tiers(1 << 20, {disk, shared});
  disk->Insert(KeyAt(1), std::make_shared<EncodedTile>());
  disk->delay = std::chrono::milliseconds(2);
  ASSERT_TRUE(tiers.FindOrBuild(KeyAt(1), BuildOf("new")));
  const std::vector<std::chrono::microseconds> times = tiers.store_times();
  ASSERT_EQ(times.size(), 2u);
  EXPECT_GE(times[0], disk->delay);
  EXPECT_EQ(times[1].count(), 0) << "it was not asked";
}

}  // namespace
}  // namespace terrace::tiler

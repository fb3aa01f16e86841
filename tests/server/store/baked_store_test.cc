#include "server/store/baked_store.h"

#include <gtest/gtest.h>

#include <utility>

namespace terrace::server {
namespace {

// Has the tile of level 0 alone; of level 1 a damaged one.
class FakeBaked final : public tiler::BakedTiles {
 public:
  tiler::Coding coding() const override { return tiler::Coding::kGzip; }
  const tiler::BakedExtent& extent() const override { return extent_; }
  Result<std::optional<tiler::EncodedTile>> Find(const tiler::TileRequest& request) const override {
    if (request.key.level == 1) return MakeError(ErrorCode::kUnavailable, "top.pmtiles is damaged");
    if (request.key.level > 1) return std::nullopt;
    tiler::EncodedTile tile;
    tile.bytes = "baked";
    return tile;
  }
  Result<dem::HeightRange> RangeBound(const geo::TileKey&) const override { return dem::HeightRange(); }
  bool HasKind(const tiler::TileRequest&) const override { return true; }
  bool is_outdated() const override { return false; }
  Error WhyAbsent(const tiler::TileRequest&) const override { return {}; }

 private:
  tiler::BakedExtent extent_;
};

tiler::CacheKey KeyOf(std::uint64_t generation, int level) {
  tiler::CacheKey key;
  key.generation = generation;
  key.request.key.level = level;
  return key;
}

tiler::Dataset DatasetOf(std::uint64_t generation) {
  tiler::Dataset dataset;
  dataset.generation = generation;
  dataset.baked = std::make_shared<const FakeBaked>();
  return dataset;
}

TEST(BakedStoreTest, FindsTilesOfTheGenerationThatWasBaked) {
  BakedStore store;
  EXPECT_FALSE(store.Find(KeyOf(7, 0)));
  store.Use({DatasetOf(7)});
  ASSERT_TRUE(store.Find(KeyOf(7, 0)));
  EXPECT_EQ(store.Find(KeyOf(7, 0))->bytes, "baked");
  EXPECT_FALSE(store.Find(KeyOf(8, 0))) << "another generation";
  EXPECT_TRUE(store.stats().on);
  store.AlsoUse({DatasetOf(8)});
  EXPECT_TRUE(store.Find(KeyOf(7, 0)) && store.Find(KeyOf(8, 0))) << "while one catalog replaces the other";
  store.Use({DatasetOf(8)});
  EXPECT_FALSE(store.Find(KeyOf(7, 0))) << "no longer served";
}

TEST(BakedStoreTest, DamagedAndAbsentTilesAreLeftToTheNextTier) {
  BakedStore store;
  store.Use({DatasetOf(7)});
  EXPECT_FALSE(store.Find(KeyOf(7, 1)));
  EXPECT_FALSE(store.Find(KeyOf(7, 2)));
  EXPECT_TRUE(store.Find(KeyOf(7, 0)));
  const tiler::StoreStats stats = store.stats();
  EXPECT_EQ(stats.errors, 1U);
  EXPECT_EQ(stats.misses, 1U);
  EXPECT_EQ(stats.hits, 1U);
}

}  // namespace
}  // namespace terrace::server

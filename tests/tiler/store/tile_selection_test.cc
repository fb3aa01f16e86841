// Which tiles a purge takes: by level, box and scheme, from keys in memory and from those of records.
#include "tiler/store/tile_selection.h"

#include <gtest/gtest.h>

#include "tiler/store/tile_record.h"

namespace terrace::tiler {
namespace {

TileSelection Of(dem::GeoBounds box, int min_level = 0, int max_level = geo::kMaxLevel) {
  TileSelection selection;
  selection.generation = 7;
  selection.min_level = min_level;
  selection.max_level = max_level;
  selection.box = box;
  return selection;
}

CacheKey Tile(geo::TileKey key, TileFormat format = TileFormat::kQuantizedMesh, std::uint64_t generation = 7) {
  CacheKey tile;
  tile.request.key = key;
  tile.request.format = format;
  tile.generation = generation;
  return tile;
}

// Of the key and of its record.
bool Takes(const TileSelection& selection, const CacheKey& key) {
  const bool taken = IsSelected(selection, key);
  EXPECT_EQ(IsSelected(selection, RecordKey(key)), taken);
  if (key.request.format != TileFormat::kHeightPng) {
    const RefinedTileKey refined{key.generation, key.request.key};
    EXPECT_EQ(IsSelected(selection, refined), taken);
    EXPECT_EQ(IsSelected(selection, RecordKey(refined)), taken);
  }
  return taken;
}

TEST(TileSelection, TakesAllOfItsDataset) {
  EXPECT_TRUE(Takes(Of({}), Tile({0, 1, 0})));
  EXPECT_TRUE(Takes(Of({}), Tile({24, 0, 0})));
  EXPECT_TRUE(Takes(Of({}), Tile({0, 0, 0}, TileFormat::kHeightPng)));
  EXPECT_FALSE(Takes(Of({}), Tile({0, 1, 0}, TileFormat::kGlb, 8)));
}

TEST(TileSelection, TakesItsLevels) {
  for (int level = 0; level <= 12; ++level) {
    EXPECT_EQ(Takes(Of({}, 8, 11), Tile({level, 0, 0})), level >= 8 && level <= 11) << level;
  }
}

// The box is a tile of level 3: 22.5 degrees wide.
TEST(TileSelection, TakesWhatOverlapsItsBoxNotWhatTouchesIt) {
  const TileSelection box = Of({0, 0, 22.5, 22.5});
  EXPECT_TRUE(Takes(box, Tile({3, 8, 4})));
  for (const geo::TileKey& neighbour : {geo::TileKey{3, 7, 4}, {3, 9, 4}, {3, 8, 3}, {3, 8, 5}}) {
    EXPECT_FALSE(Takes(box, Tile(neighbour))) << geo::ToString(neighbour);
  }
  EXPECT_TRUE(Takes(box, Tile({0, 1, 0}))) << "above it";
  EXPECT_TRUE(Takes(box, Tile({5, 35, 19}))) << "inside";
}

// Tile 1/1/0 of Web Mercator is the north-east of the Earth, 1/1/1 the south-east.
TEST(TileSelection, CountsRowsOfHeightTilesFromTheNorth) {
  const TileSelection box = Of({10, 10, 20, 20});
  EXPECT_TRUE(Takes(box, Tile({1, 1, 0}, TileFormat::kHeightPng)));
  EXPECT_FALSE(Takes(box, Tile({1, 1, 1}, TileFormat::kHeightPng)));
  EXPECT_FALSE(Takes(box, Tile({1, 0, 0}, TileFormat::kHeightPng)));
}

TEST(TileSelection, CrossesTheAntimeridian) {
  const TileSelection box = Of({170, -10, -170, 10});
  EXPECT_TRUE(Takes(box, Tile({3, 0, 4})));
  EXPECT_TRUE(Takes(box, Tile({3, 15, 4})));
  EXPECT_FALSE(Takes(box, Tile({3, 8, 4})));
}

TEST(TileSelection, FindsRecordsByTheirPrefix) {
  const std::string key = RecordKey(Tile({9, 533, 388}));
  EXPECT_TRUE(key.starts_with(RecordPrefix(7, 9)));
  EXPECT_FALSE(key.starts_with(RecordPrefix(7, 8)));
  EXPECT_FALSE(key.starts_with(RecordPrefix(8, 9)));
  EXPECT_FALSE(IsSelected(Of({}), key.substr(0, 20))) << "no key";
}

}  // namespace
}  // namespace terrace::tiler

#include "engine/geo/tile_key.h"

#include <gtest/gtest.h>

namespace terrace::geo {
namespace {

TEST(TileKey, HasTwoRootsAndFourChildrenEach) {
  EXPECT_EQ(TileColumns(0), 2);
  EXPECT_EQ(TileRows(0), 1);
  EXPECT_EQ(TileColumns(9), 1024);
  EXPECT_EQ(TileRows(9), 512);
  EXPECT_EQ(TileColumns(kMaxLevel), std::int64_t{1} << 25);
}

TEST(TileKey, IsValidInsideItsLevelOnly) {
  EXPECT_TRUE(IsValid({0, 0, 0}));
  EXPECT_TRUE(IsValid({0, 1, 0}));
  EXPECT_TRUE(IsValid({kMaxLevel, TileColumns(kMaxLevel) - 1, TileRows(kMaxLevel) - 1}));
  EXPECT_FALSE(IsValid({0, 2, 0}));
  EXPECT_FALSE(IsValid({0, 0, 1}));
  EXPECT_FALSE(IsValid({3, -1, 0}));
  EXPECT_FALSE(IsValid({3, 0, -1}));
  EXPECT_FALSE(IsValid({-1, 0, 0}));
  EXPECT_FALSE(IsValid({kMaxLevel + 1, 0, 0}));
}

TEST(TileKey, NeighboursGoRoundTheEarthButNotOverThePoles) {
  EXPECT_EQ(Neighbour({2, 7, 1}, 1, 0), (TileKey{2, 0, 1}));
  EXPECT_EQ(Neighbour({2, 0, 1}, -1, 1), (TileKey{2, 7, 2}));
  EXPECT_EQ(Neighbour({2, 3, 1}, -17, 0), (TileKey{2, 2, 1}));
  EXPECT_FALSE(IsValid(Neighbour({2, 0, 3}, 0, 1)));
  EXPECT_FALSE(IsValid(Neighbour({2, 0, 0}, 0, -1)));
}

TEST(TileKey, PrintsLevelThenColumnThenRow) { EXPECT_EQ(ToString(TileKey{9, 533, 388}), "9/533/388"); }

TEST(TileRange, IsInclusive) {
  const TileRange range{2, 3, 5, 3};
  EXPECT_TRUE(range.Contains({9, 2, 3}));
  EXPECT_TRUE(range.Contains({9, 5, 3}));
  EXPECT_FALSE(range.Contains({9, 6, 3}));
  EXPECT_FALSE(range.Contains({9, 2, 4}));
  EXPECT_FALSE(TileRange{}.Contains({9, 0, 0}));
}

}  // namespace
}  // namespace terrace::geo

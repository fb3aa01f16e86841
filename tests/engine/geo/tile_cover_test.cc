#include "engine/geo/tile_cover.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>

namespace terrace::geo {
namespace {

using Cell = std::pair<std::int64_t, std::int64_t>;

std::set<Cell> CellsOf(const std::vector<TileRange>& ranges) {
  std::set<Cell> cells;
  for (const TileRange& range : ranges) {
    for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) cells.insert({x, y});
    }
  }
  return cells;
}

std::int64_t Count(const std::vector<TileRange>& ranges) {
  std::int64_t count = 0;
  for (const TileRange& range : ranges) count += Cells(range);
  return count;
}

std::vector<TileRange> RandomRanges(std::mt19937& random, int count) {
  std::vector<TileRange> ranges;
  for (int i = 0; i < count; ++i) {
    const auto x = static_cast<std::int64_t>(random() % 20), y = static_cast<std::int64_t>(random() % 20);
    ranges.push_back({x, y, x + static_cast<std::int64_t>(random() % 8), y + static_cast<std::int64_t>(random() % 8)});
  }
  return ranges;
}

TEST(TileCover, HoldsEveryCellOnceInOrder) {
  std::mt19937 random(1);
  for (int round = 0; round < 500; ++round) {
    const std::vector<TileRange> ranges = RandomRanges(random, round % 12);
    const std::vector<TileRange> cover = Disjoint(ranges);
    ASSERT_EQ(CellsOf(cover), CellsOf(ranges)) << round;
    ASSERT_EQ(Count(cover), static_cast<std::int64_t>(CellsOf(ranges).size())) << "overlap in round " << round;
    ASSERT_TRUE(std::ranges::is_sorted(cover, {}, [](const TileRange& r) { return std::pair(r.start_y, r.start_x); }));
  }
}

TEST(TileCover, JoinsWhatLiesSideBySideOrOnTop) {
  EXPECT_EQ(Disjoint({{0, 0, 3, 3}, {4, 0, 7, 3}, {0, 4, 7, 5}}), (std::vector<TileRange>{{0, 0, 7, 5}}));
  EXPECT_EQ(Disjoint({{2, 0, 3, 1}, {0, 0, 0, 1}}), (std::vector<TileRange>{{0, 0, 0, 1}, {2, 0, 3, 1}}));
  EXPECT_TRUE(Disjoint({{0, 0, -1, 5}}).empty());
}

}  // namespace
}  // namespace terrace::geo

// The available tiles of several rasters together.
#include "engine/mosaic/availability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

TEST(Availability, DeepTilesLieOnlyWhereAFineSourceDoes) {
  const TempDir dir;
  const std::string base = WriteRaster(dir, FlatSquare(-180, 90, 90, 2, 5), "base.tif");  // half the Earth
  const std::string fine = WriteRaster(dir, FlatSquare(-99.99, 50, 100, 0.001, 50), "fine.tif");
  const auto source = OpenOrFail({{fine, 0}, {base, 1}});
  const auto alone = OpenOrFail(base);
  const auto finest = OpenOrFail(fine);
  ASSERT_TRUE(source && alone && finest);
  ASSERT_EQ(source->max_level(), finest->max_level());
  ASSERT_LT(alone->max_level() + 4, finest->max_level());
  for (int level = 0; level <= source->max_level(); ++level) {
    const auto& ranges = source->Available(level);
    for (const geo::TileRange& range : finest->Available(level)) {
      for (const auto& [x, y] : {std::pair(range.start_x, range.start_y), {range.end_x, range.end_y}}) {
        EXPECT_TRUE(source->IsAvailable({level, x, y}));
      }
    }
    std::int64_t tiles = 0;
    for (const geo::TileRange& range : ranges) {
      tiles += (range.end_x - range.start_x + 1) * (range.end_y - range.start_y + 1);
      if (level == 0) continue;
      for (std::int64_t y = range.start_y; y <= std::min(range.end_y, range.start_y + 40); ++y) {
        for (std::int64_t x = range.start_x; x <= std::min(range.end_x, range.start_x + 40); ++x) {
          EXPECT_TRUE(source->IsAvailable({level - 1, x / 2, y / 2}));
        }
      }
    }
    if (level > alone->max_level()) {
      std::int64_t fine_tiles = 0;
      for (const geo::TileRange& r : finest->Available(level)) {
        fine_tiles += (r.end_x - r.start_x + 3) * (r.end_y - r.start_y + 3);
      }
      EXPECT_LE(tiles, fine_tiles) << level;
    }
  }
  EXPECT_FALSE(source->IsAvailable({source->max_level(), 5, 5}));
}

// 3D Tiles clients replace a tile by its children: a missing one is a hole.
TEST(Availability, ATileHasFourChildrenOrNoneWhereACellIsMissing) {
  const TempDir dir;
  std::vector<DemFile> files;
  for (const auto& [west, north] : {std::pair(10, 50), {11, 50}, {10, 51}}) {  // three of four cells
    files.push_back(
        {WriteRaster(dir, FlatSquare(west, north, 100, 0.01, 5), std::to_string(west + 100 * north) + ".tif")});
  }
  const auto source = OpenOrFail(files);
  ASSERT_NE(source, nullptr);
  for (int level = 1; level <= source->max_level(); ++level) {
    for (const geo::TileRange& range : source->Available(level)) {
      for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
        for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
          for (const std::int64_t child : {0, 1, 2, 3}) {
            ASSERT_TRUE(source->IsAvailable({level, x / 2 * 2 + child % 2, y / 2 * 2 + child / 2})) << level;
          }
        }
      }
    }
  }
}

bool Has(const std::vector<std::vector<geo::TileRange>>& levels, const geo::TileKey& key) {
  return std::ranges::any_of(levels[static_cast<std::size_t>(key.level)],
                             [&](const geo::TileRange& range) { return range.Contains(key); });
}

// Across the antimeridian, at a pole, and along a diagonal that would be more ranges than documents should have.
TEST(Availability, OfAddedTilesIsGraded) {
  std::vector<geo::TileRange> diagonal;
  for (std::int64_t i = 0; i < 6000; ++i) diagonal.push_back({5000 + i, 4000 + i, 5000 + i, 4000 + i});
  const FinerTiles finer[] = {{9, {{0, 200, 0, 200}, {700, 0, 700, 0}, {1023, 511, 1023, 511}}}, {14, diagonal}};
  const std::vector<std::vector<geo::TileRange>> before = {{{0, 0, 1, 0}}, {{0, 0, 1, 1}}};
  std::vector<std::vector<geo::TileRange>> levels = before;
  const auto added = AddTiles(levels, finer);
  ASSERT_EQ(levels.size(), 15u);
  ASSERT_EQ(added.size(), levels.size());
  EXPECT_EQ(levels[0], before[0]);
  for (int level = 1; level <= 14; ++level) {
    const auto at = static_cast<std::size_t>(level);
    EXPECT_LE(levels[at].size(), 2000u) << level;
    if (level > 1) {
      EXPECT_EQ(added[at], levels[at]);
    }
    int missing = 0;
    for (const geo::TileRange& range : added[at]) {
      for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
        for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
          for (int around = 0; around < 9; ++around) {
            const geo::TileKey beside = geo::Neighbour({level, x, y}, around % 3 - 1, around / 3 - 1);
            if (!geo::IsValid(beside)) continue;
            missing += Has(levels, {level - 1, beside.x / 2, beside.y / 2}) ? 0 : 1;
          }
        }
      }
    }
    EXPECT_EQ(missing, 0) << level;
  }
  EXPECT_TRUE(Has(levels, {8, 511, 99}) && Has(levels, {8, 511, 100}));
  EXPECT_EQ(added[1], (std::vector<geo::TileRange>{{2, 0, 3, 1}}));
}

}  // namespace
}  // namespace terrace::dem

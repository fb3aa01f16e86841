#include "proto/documents/subtree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "tests/proto/subtree_reader.h"

namespace terrace::proto {
namespace {

// Bit by bit from the definition: y1 x1 y0 x0.
std::size_t Interleave(std::size_t x, std::size_t y) {
  std::size_t index = 0;
  for (int bit = 0; bit < 16; ++bit) index |= (x >> bit & 1) << (2 * bit) | (y >> bit & 1) << (2 * bit + 1);
  return index;
}

std::size_t BitOf(int level, std::size_t x, std::size_t y) {
  std::size_t first = 0;
  for (int k = 0; k < level; ++k) first += std::size_t{1} << (2 * k);
  return first + Interleave(x, y);
}

Subtree Full(int levels) {
  Subtree subtree;
  subtree.levels = levels;
  for (int k = 0; k <= levels; ++k) {
    const std::int64_t last = (std::int64_t{1} << k) - 1;
    subtree.tiles.push_back({{0, 0, last, last}});
  }
  return subtree;
}

// A block of the deepest level and all above it.
Subtree Around(int levels, geo::TileRange deepest) {
  Subtree subtree;
  subtree.levels = levels;
  for (int up = levels; up >= 0; --up) {
    subtree.tiles.push_back({{deepest.start_x >> up, deepest.start_y >> up, deepest.end_x >> up, deepest.end_y >> up}});
  }
  return subtree;
}

TEST(Subtree, MortonInterleavesXIntoTheEvenBits) {
  EXPECT_EQ(MortonIndex(1, 0), 1u);
  EXPECT_EQ(MortonIndex(0, 1), 2u);
  EXPECT_EQ(MortonIndex(3, 1), 7u);
  std::mt19937 random(7);
  for (int i = 0; i < 1000; ++i) {
    const std::uint32_t x = random() & 0xffff, y = random() & 0xffff;
    EXPECT_EQ(MortonIndex(x, y), Interleave(x, y)) << x << " " << y;
  }
}

TEST(Subtree, BytesOfASmallOneAreAsTheSpecificationSays) {
  // Two levels: the root, its south-eastern child, and below that the two western roots of child subtrees.
  Subtree subtree;
  subtree.levels = 2;
  subtree.tiles = {{{0, 0, 0, 0}}, {{1, 0, 1, 0}}, {{2, 0, 2, 1}}};
  const std::string json =
      R"({"buffers":[{"byteLength":16}],"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":1},)"
      R"({"buffer":0,"byteOffset":8,"byteLength":2}],"tileAvailability":{"bitstream":0,"availableCount":2},)"
      R"("contentAvailability":[{"bitstream":0,"availableCount":2}],)"
      R"("childSubtreeAvailability":{"bitstream":1,"availableCount":2}})";
  const std::string padding((8 - json.size() % 8) % 8, ' ');
  std::string expected("subt\1\0\0\0", 8);
  expected += static_cast<char>((json.size() + padding.size()) & 0xff);
  expected += static_cast<char>((json.size() + padding.size()) >> 8);
  expected += std::string(6, '\0') + '\x10' + std::string(7, '\0') + json + padding;
  // Tiles: bit 0 and bit 1 + 1. Children: Morton (2, 0) = 4 and (2, 1) = 6.
  expected += '\x05' + std::string(7, '\0') + '\x50' + std::string(7, '\0');
  EXPECT_EQ(EncodeSubtree(subtree), expected);
}

TEST(Subtree, EveryTileIsWhereTheReaderLooksForIt) {
  for (const geo::TileRange& block : {geo::TileRange{0, 0, 0, 0}, geo::TileRange{13, 5, 17, 40},
                                      geo::TileRange{63, 63, 63, 63}, geo::TileRange{0, 31, 63, 32}}) {
    const Subtree subtree = Around(6, block);
    const Result<ReadSubtree> read = ParseSubtree(EncodeSubtree(subtree), 6);
    ASSERT_TRUE(read) << read.error().message;
    for (int level = 0; level <= 6; ++level) {
      for (std::int64_t y = 0; y < 1 << level; ++y) {
        for (std::int64_t x = 0; x < 1 << level; ++x) {
          const bool expected = subtree.tiles[static_cast<std::size_t>(level)][0].Contains({level, x, y});
          const std::size_t at = static_cast<std::size_t>(x), row = static_cast<std::size_t>(y);
          if (level == 6) {
            ASSERT_EQ(read->children[Interleave(at, row)], expected) << x << " " << y;
          } else {
            ASSERT_EQ(read->tiles[BitOf(level, at, row)], expected) << level << " " << x << " " << y;
          }
        }
      }
    }
    EXPECT_EQ(read->contents, read->tiles) << "every tile has content";
  }
}

TEST(Subtree, UniformAvailabilityIsAConstant) {
  const Result<ReadSubtree> full = ParseSubtree(EncodeSubtree(Full(5)), 5);
  ASSERT_TRUE(full) << full.error().message;
  EXPECT_TRUE(full->tiles_constant && full->children_constant);
  EXPECT_EQ(full->json.find("buffer"), std::string::npos) << "nothing in the binary chunk: " << full->json;
  EXPECT_TRUE(full->tiles[0] && full->children[0]);

  Subtree leaf = Full(5);
  leaf.tiles.back().clear();
  const Result<ReadSubtree> bottom = ParseSubtree(EncodeSubtree(leaf), 5);
  ASSERT_TRUE(bottom) << bottom.error().message;
  EXPECT_TRUE(bottom->tiles_constant && bottom->children_constant);
  EXPECT_TRUE(bottom->tiles[0]);
  EXPECT_FALSE(bottom->children[0]);
}

TEST(Subtree, OneLevelIsEnough) {
  Subtree single = Full(1);
  EXPECT_TRUE(ParseSubtree(EncodeSubtree(single), 1));
  single.tiles.back() = {{1, 1, 1, 1}};
  const Result<ReadSubtree> read = ParseSubtree(EncodeSubtree(single), 1);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->children, (BitList{false, false, false, true}));
}

TEST(Subtree, TheDeepestPossibleReadsBack) {
  const Result<ReadSubtree> read =
      ParseSubtree(EncodeSubtree(Around(kMaxSubtreeLevels, {1023, 0, 1023, 1})), kMaxSubtreeLevels);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->children[Interleave(1023, 1)]);
  EXPECT_FALSE(read->children[Interleave(1022, 1)]);
}

TEST(Subtree, SeparateBlocksOfALevelAreAllThere) {
  Subtree subtree;
  subtree.levels = 2;
  subtree.tiles = {{{0, 0, 0, 0}}, {{0, 0, 0, 1}, {1, 1, 1, 1}}, {}};
  const Result<ReadSubtree> read = ParseSubtree(EncodeSubtree(subtree), 2);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->tiles, (BitList{true, true, false, true, true}));
}

// Different for each tile, so that a wrong order is noticed.
HeightSpan HeightsOf(const geo::TileKey& key) {
  const auto number = static_cast<double>(1000 * key.level + 31 * key.x + key.y);
  return {-number - 0.25, number + 0.5};
}

TEST(Subtree, EveryTileHasHeightsThatHoldThoseBelowIt) {
  Subtree ragged = Around(6, {13, 5, 17, 40});
  Subtree full = Full(4);
  for (Subtree* subtree : {&ragged, &full}) {
    subtree->heights = HeightsOf;
    const int levels = subtree->levels;
    const Result<ReadSubtree> read = ParseSubtree(EncodeSubtree(*subtree), levels);
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->min_heights.size(), read->tiles.size());
    for (int level = 0; level < levels; ++level) {
      for (std::int64_t y = 0; y < 1 << level; ++y) {
        for (std::int64_t x = 0; x < 1 << level; ++x) {
          if (!subtree->tiles[static_cast<std::size_t>(level)][0].Contains({level, x, y})) continue;
          // The tile's own heights are less than those of the highest tile of the deepest level below it.
          const int down = levels - 1 - level;
          const geo::TileRange& deepest = subtree->tiles[static_cast<std::size_t>(levels - 1)][0];
          const HeightSpan expected = HeightsOf({levels - 1, std::min(((x + 1) << down) - 1, deepest.end_x),
                                                 std::min(((y + 1) << down) - 1, deepest.end_y)});
          const std::size_t bit = BitOf(level, static_cast<std::size_t>(x), static_cast<std::size_t>(y));
          ASSERT_EQ(static_cast<double>(read->min_heights[bit]), expected.min_m) << level << " " << x << " " << y;
          ASSERT_EQ(static_cast<double>(read->max_heights[bit]), expected.max_m) << level << " " << x << " " << y;
        }
      }
    }
  }
}

TEST(Subtree, EveryTruncationIsRefused) {
  Subtree subtree = Around(4, {3, 3, 9, 12});
  subtree.heights = HeightsOf;
  const std::string file = EncodeSubtree(subtree);
  ASSERT_TRUE(ParseSubtree(file, 4));
  for (std::size_t size = 0; size < file.size(); ++size) {
    EXPECT_FALSE(ParseSubtree(std::string_view(file).substr(0, size), 4)) << size << " bytes";
  }
  EXPECT_FALSE(ParseSubtree(file + std::string(8, '\0'), 4)) << "bytes behind the last chunk";
  EXPECT_FALSE(ParseSubtree(file, 5)) << "a bitstream too short for one more level";
}

TEST(Subtree, TheSameTilesGiveTheSameBytes) {
  EXPECT_EQ(EncodeSubtree(Around(6, {1, 2, 3, 4})), EncodeSubtree(Around(6, {1, 2, 3, 4})));
}

}  // namespace
}  // namespace terrace::proto

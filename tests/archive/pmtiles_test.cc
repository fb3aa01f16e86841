#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "archive/pmtiles/directory.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles/pmtiles_writer.h"
#include "archive/pmtiles/tile_id.h"
#include "tests/archive/small_archive.h"
#include "tests/support/scratch_directory.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::archive {
namespace {

// The first ids, and ids that the specification's own tests state.
TEST(TileIdTest, FollowsTheSpecification) {
  EXPECT_EQ(TileIdOf({0, 0, 0}), 0U);
  EXPECT_EQ(TileIdOf({1, 0, 0}), 1U);
  EXPECT_EQ(TileIdOf({1, 0, 1}), 2U);
  EXPECT_EQ(TileIdOf({1, 1, 1}), 3U);
  EXPECT_EQ(TileIdOf({1, 1, 0}), 4U);
  EXPECT_EQ(TileIdOf({2, 0, 0}), 5U);
  EXPECT_EQ(TileIdOf({12, 3423, 1763}), 19078479U);
}

TEST(TileIdTest, GoesBothWays) {
  std::set<std::uint64_t> ids;
  for (int zoom = 0; zoom <= 6; ++zoom) {
    for (std::uint64_t x = 0; x < std::uint64_t{1} << zoom; ++x) {
      for (std::uint64_t y = 0; y < std::uint64_t{1} << zoom; ++y) {
        const PmtilesKey key{zoom, x, y};
        EXPECT_EQ(KeyOf(TileIdOf(key)), key);
        ids.insert(TileIdOf(key));
      }
    }
  }
  EXPECT_EQ(ids.size(), 5461U);
  EXPECT_EQ(*ids.rbegin(), 5460U);
  const std::uint64_t last = (std::uint64_t{1} << kMaxZoom) - 1;
  for (const PmtilesKey& key :
       {PmtilesKey{kMaxZoom, 0, 0}, PmtilesKey{kMaxZoom, last, last}, PmtilesKey{kMaxZoom, 12345678, last}}) {
    EXPECT_EQ(KeyOf(TileIdOf(key)), key);
  }
  EXPECT_FALSE(KeyOf(~std::uint64_t{0}));
}

TEST(DirectoryTest, GoesBothWays) {
  const std::vector<DirectoryEntry> entries = {{0, 0, 10, 1},
                                               {1, 10, 5, 3},
                                               {9, 0, 10, 1},
                                               {70'000'000'000, 15, 1'000'000, 1},
                                               {70'000'000'009, 5'000'000'000, 1, 1}};
  const Result<std::vector<DirectoryEntry>> read = DecodeDirectory(EncodeDirectory(entries), 0, 5'000'000'001, 5);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, entries);
}

TEST(DirectoryTest, EntriesBeyondTheFileAreRefused) {
  const std::vector<DirectoryEntry> entries = {{0, 0, 10, 1}, {1, 10, 5, 1}};
  EXPECT_TRUE(DecodeDirectory(EncodeDirectory(entries), 0, 15, 2));
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory(entries), 0, 14, 2));
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory({{0, ~std::uint64_t{0} - 1, 10, 1}}), 0, 100, 2)) << "offset overflows";
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory({{0, 0, 0, 1}}), 0, 100, 2)) << "empty tile";
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory({{5, 0, 1, 3}, {7, 1, 1, 1}}), 0, 100, 2)) << "runs overlap";
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory({{5, 0, 1, 1}, {5, 1, 1, 1}}), 0, 100, 2)) << "an id twice";
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory({{~std::uint64_t{0}, 0, 1, 1}}), 0, 100, 2)) << "id overflows";
  EXPECT_FALSE(DecodeDirectory(EncodeDirectory({}), 0, 100, 2)) << "no entries";
  EXPECT_FALSE(DecodeDirectory("", 0, 100, 2));
}

// A leaf of 4 MB in 4 kB, in a file that has no room for the rows of its tiles.
TEST(DirectoryTest, MoreEntriesThanTheFileHasRoomForAreRefusedBeforeTheyAreDecompressed) {
  std::vector<DirectoryEntry> entries(1'000'000);
  for (std::size_t i = 0; i < entries.size(); ++i) entries[i] = {i, i, 1, 1};
  const std::string leaf = EncodeDirectory(entries);
  EXPECT_LT(leaf.size(), 50'000U);
  EXPECT_TRUE(DecodeDirectory(leaf, 0, entries.size(), entries.size()));
  EXPECT_FALSE(DecodeDirectory(leaf, 0, entries.size(), entries.size() - 1));
  EXPECT_FALSE(DecodeDirectory(leaf, 0, entries.size(), 1000));
}

class PmtilesTest : public ::testing::Test {
 protected:
  std::string Path(const char* name = "a.pmtiles") const { return (scratch_.path() / name).string(); }

  static PmtilesWriter NewWriter(const std::string& path) {
    Result<PmtilesWriter> writer = PmtilesWriter::Create(path, {});
    EXPECT_TRUE(writer);
    return *std::move(writer);
  }

  test_support::ScratchDirectory scratch_;
};

tiler::EncodedTile TileOf(std::uint64_t id) {
  return InventedTile({5, static_cast<std::int64_t>(id % 64), static_cast<std::int64_t>(id % 3)});
}

TEST_F(PmtilesTest, EveryTileIsFoundAndNoOther) {
  PmtilesWriter writer = NewWriter(Path());
  constexpr std::uint64_t kTiles = 20'000;  // several leaf directories
  for (std::uint64_t id = 0; id < kTiles; ++id) ASSERT_TRUE(writer.Add(id * 2, TileOf(id), {1.5, 2.25}));
  const Result<FileSummary> unit_file = writer.Finish(R"({"a":1})");
  ASSERT_TRUE(unit_file) << unit_file.error().message;
  EXPECT_EQ(unit_file->tiles, kTiles);
  EXPECT_EQ(unit_file->bytes, std::filesystem::file_size(Path()));

  const Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(Path());
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ((*file)->metadata(), R"({"a":1})");
  EXPECT_EQ((*file)->header().tiles, kTiles);
  EXPECT_LT((*file)->header().contents, 200U) << "equal bytes are kept once";
  for (std::uint64_t id = 0; id < kTiles; ++id) {
    const Result<std::optional<ArchivedTile>> found = (*file)->Find(id * 2);
    ASSERT_TRUE(found && *found);
    const tiler::EncodedTile wanted = TileOf(id);
    ASSERT_EQ((*found)->tile.bytes, wanted.bytes);
    ASSERT_EQ(tiler::StrongETag((*found)->tile.bytes), wanted.etag);
    ASSERT_EQ((*found)->tile.certified_error_m, wanted.certified_error_m);
    ASSERT_EQ((*found)->tile.vertices, wanted.vertices);
    ASSERT_EQ((*found)->range.max, 2.25);
    const Result<std::optional<ArchivedTile>> none = (*file)->Find(id * 2 + 1);
    ASSERT_TRUE(none && !*none);
  }
}

TEST_F(PmtilesTest, OrderOfAddingDoesNotChangeTheFile) {
  std::vector<std::uint64_t> ids(500);
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = i;
  for (const char* name : {"a", "b"}) {
    PmtilesWriter writer = NewWriter(Path(name));
    for (const std::uint64_t id : ids) ASSERT_TRUE(writer.Add(id, TileOf(id), {}));
    ASSERT_TRUE(writer.Finish("{}"));
    std::ranges::reverse(ids);
  }
  EXPECT_EQ(FileText(Path("a")), FileText(Path("b")));
}

TEST_F(PmtilesTest, TileAddedTwiceIsAnError) {
  PmtilesWriter writer = NewWriter(Path());
  ASSERT_TRUE(writer.Add(3, TileOf(3), {}));
  ASSERT_TRUE(writer.Add(3, TileOf(4), {}));
  EXPECT_FALSE(writer.Finish("{}"));
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

TEST_F(PmtilesTest, UnfinishedWriterLeavesNothing) {
  {
    PmtilesWriter writer = NewWriter(Path());
    ASSERT_TRUE(writer.Add(3, TileOf(3), {}));
  }
  EXPECT_TRUE(std::filesystem::is_empty(scratch_.path()));
}

TEST_F(PmtilesTest, NoTilesNoFile) {
  WriteText(Path(), "old");
  PmtilesWriter writer = NewWriter(Path());
  const Result<FileSummary> unit_file = writer.Finish("{}");
  ASSERT_TRUE(unit_file);
  EXPECT_EQ(unit_file->tiles, 0U);
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

}  // namespace
}  // namespace terrace::archive

// Files that were damaged, cut short or made to harm: an error or the right bytes, never a wrong tile.
#include <gtest/gtest.h>

#include <filesystem>

#include "archive/archive.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles_mapping.h"
#include "archive/static_tileset.h"
#include "tests/archive/small_archive.h"
#include "tests/support/scratch_directory.h"

namespace terrace::archive {
namespace {

class HostileArchiveTest : public ::testing::Test {
 protected:
  HostileArchiveTest() {
    for (int level = 0; level <= 1; ++level) {
      for (std::int64_t x = 0; x < geo::TileColumns(level); ++x) {
        for (std::int64_t y = 0; y < geo::TileRows(level); ++y) keys_.push_back({level, x, y});
      }
    }
    const Manifest manifest = WriteUnits(place_, keys_);
    EXPECT_TRUE(WriteManifest(place_, manifest));
    good_ = FileText(unit_);
  }

  // Returns how many tiles could be read.
  int ReadAll() const {
    const auto archive = Archive::Open(place_);
    EXPECT_TRUE(archive);
    int read = 0;
    for (const geo::TileKey& key : keys_) {
      const Result<std::optional<ArchivedTile>> found = (*archive)->Find(key);
      if (!found) {
        EXPECT_EQ(found.error().code, ErrorCode::kUnavailable);
        EXPECT_NE(found.error().message.find(unit_), std::string::npos) << found.error().message;
        continue;
      }
      EXPECT_TRUE(*found) << "a tile is gone without an error";
      if (!*found) continue;
      const tiler::EncodedTile wanted = InventedTile(key);
      EXPECT_EQ((*found)->tile.bytes, wanted.bytes);
      EXPECT_EQ((*found)->tile.max_error_m, wanted.max_error_m);
      EXPECT_EQ((*found)->tile.certified_error_m, wanted.certified_error_m);
      EXPECT_EQ((*found)->range.max, InventedRange(key).max);
      ++read;
    }
    return read;
  }

  const test_support::ScratchDirectory scratch_;
  const std::string place_ = (scratch_.path() / "baked").string();
  const std::string unit_ = place_ + "/top.pmtiles";
  std::vector<geo::TileKey> keys_;
  std::string good_;
};

TEST_F(HostileArchiveTest, EveryTruncation) {
  EXPECT_EQ(ReadAll(), static_cast<int>(keys_.size()));
  for (std::size_t size = 0; size < good_.size(); ++size) {
    WriteText(unit_, good_.substr(0, size));
    ASSERT_EQ(ReadAll(), 0) << size;
  }
  WriteText(unit_, good_ + "x");
  EXPECT_EQ(ReadAll(), 0);
}

TEST_F(HostileArchiveTest, EveryFlippedByte) {
  int unharmed = 0;
  for (std::size_t at = 0; at < good_.size(); ++at) {
    for (const int flip : {0x01, 0x80, 0xff}) {
      std::string bad = good_;
      bad[at] = static_cast<char>(bad[at] ^ flip);
      WriteText(unit_, bad);
      unharmed += ReadAll() == static_cast<int>(keys_.size()) ? 1 : 0;
      if (HasFailure()) FAIL() << "byte " << at << " of " << good_.size();
    }
  }
  // What other readers of PMTiles need alone, and idle bits of gzip.
  EXPECT_LT(unharmed, 300);
}

TEST_F(HostileArchiveTest, FlippedBytesAreFoundByVerifying) {
  const Manifest manifest = Archive::Open(place_).value()->manifest();
  for (std::size_t at = 0; at < good_.size(); at += 7) {
    std::string bad = good_;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    WriteText(unit_, bad);
    const Result<FileSummary> good = VerifyUnit(place_, "top", {manifest.kind, 7});
    if (!good) continue;
    EXPECT_NE(good->xxh3, manifest.units.front().xxh3);
  }
}

TEST_F(HostileArchiveTest, BytesOfOneTileInPlaceOfAnother) {
  const auto file = PmtilesFile::Open(unit_);
  ASSERT_TRUE(file);
  // Tiles 1/0/1 and 1/1/1 have the same length but for their names: exchange their bytes.
  std::string bad = good_;
  const std::size_t a = bad.find("tile 1/0/1"), b = bad.find("tile 1/1/1");
  ASSERT_NE(a, std::string::npos);
  ASSERT_NE(b, std::string::npos);
  bad[a + 7] = '1';
  bad[b + 7] = '0';
  WriteText(unit_, bad);
  EXPECT_EQ(ReadAll(), static_cast<int>(keys_.size()) - 2);
}

TEST_F(HostileArchiveTest, RepairedFileIsOpenedAgain) {
  std::string bad = good_;
  bad[bad.find("tile 1/0/1") + 7] = '9';
  std::filesystem::remove(unit_);  // another file, as when it is copied again
  WriteText(unit_, bad);
  const auto archive = Archive::Open(place_);
  ASSERT_TRUE(archive);
  int damaged = 0;
  for (const geo::TileKey& key : keys_) damaged += (*archive)->Find(key) ? 0 : 1;
  EXPECT_EQ(damaged, 1);
  std::filesystem::remove(unit_);
  WriteText(unit_, good_);
  for (int round = 0; round < 2; ++round) {
    damaged = 0;
    for (const geo::TileKey& key : keys_) damaged += (*archive)->Find(key) ? 0 : 1;
  }
  EXPECT_EQ(damaged, 0);
}

TEST_F(HostileArchiveTest, LeafThatNamesItself) {
  PmtilesHeader header = *DecodeHeader(good_, good_.size());
  const std::string leaf = EncodeDirectory({{0, 0, 60, 0}});
  const std::string root = EncodeDirectory({{0, 0, static_cast<std::uint32_t>(leaf.size()), 0}});
  const std::string metadata = good_.substr(header.metadata.offset, header.metadata.length);
  header.root = {kHeaderBytes, root.size()};
  header.metadata = {header.root.end(), metadata.size()};
  header.leaves = {header.metadata.end(), leaf.size() + 100};
  header.data = {header.leaves.end(), 50};
  WriteText(unit_, EncodeHeader(header) + root + metadata + leaf + std::string(150, 'x'));
  const auto file = PmtilesFile::Open(unit_);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_FALSE((*file)->Find(0));
  EXPECT_FALSE((*file)->ForEach([](std::uint64_t, const ArchivedTile&) -> Result<void> { return {}; }));
}

TEST_F(HostileArchiveTest, ManifestCutShortOrFlipped) {
  const std::string path = place_ + "/manifest.json", good = FileText(path);
  for (std::size_t size = 0; size + 2 < good.size(); ++size) {
    WriteText(path, good.substr(0, size));
    ASSERT_FALSE(Archive::Open(place_)) << size;
  }
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x04);
    WriteText(path, bad);
    const auto archive = Archive::Open(place_);
    if (!archive) continue;
    ASSERT_EQ(ToJson((*archive)->manifest()), good) << at;  // the name of the checksum was changed, nothing else
  }
}

// What a tileset is made of comes from the manifest: it must not end the process.
TEST_F(HostileArchiveTest, TilesetOfAWrongManifest) {
  Manifest good = WriteUnits(place_, keys_);
  good.kind.format = tiler::TileFormat::kGlb;
  good.max_level = good.dataset.max_level = good.dataset.max_source_level = 1;
  good.available.resize(2);
  good.error_steps = {0, 0};
  const auto tileset_of = [&](const Manifest& manifest) {
    EXPECT_TRUE(WriteManifest(place_, manifest));
    const auto archive = Archive::Open(place_);
    if (!archive) return std::string();
    std::string tileset;
    const auto take = [&](const std::string& path, std::string_view bytes, bool) -> Result<void> {
      if (path == "tileset.json") tileset = bytes;
      return {};
    };
    static_cast<void>(ForEachFileOfTileset(**archive, /*has_versions=*/false, take, {}));
    return tileset;
  };
  for (const dem::GeoBounds& bounds : {dem::GeoBounds{10, -33, 11, -32}, {400, -33, 401, -32}, {180, -33, 190, -32}}) {
    Manifest manifest = good;
    manifest.dataset.bounds = bounds;
    std::erase_if(manifest.available[1], [](const geo::TileRange& range) { return range.start_x > 0; });
    EXPECT_NE(tileset_of(manifest), "") << bounds.west;
  }
  Manifest manifest = good;
  manifest.available[0].clear();
  EXPECT_EQ(tileset_of(manifest), "");
  manifest.available[0] = good.available[0];
  for (const std::size_t level : {1, 2}) {  // as in an area beside the finest source; a gap
    manifest.max_level = manifest.dataset.max_level = 2;
    manifest.error_steps = {0, 0, 0};
    manifest.available.assign(3, good.available[0]);
    manifest.available[level].clear();
    EXPECT_NE(tileset_of(manifest), "") << level;
  }
  for (const int step : {-1000, -17, 25, 1000}) {
    manifest = good;
    manifest.error_steps = {0, step};
    EXPECT_EQ(tileset_of(manifest), "") << step;
  }
  EXPECT_NE(tileset_of(good), "");
}

}  // namespace
}  // namespace terrace::archive

#include "archive/archive.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <iterator>
#include <memory>
#include <set>
#include <vector>

#include "archive/documents.h"
#include "archive/export.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/unit_writer.h"
#include "engine/common/idle_pool.h"
#include "tests/archive/small_archive.h"
#include "tests/support/scratch_directory.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::archive {
namespace {

class ArchiveTest : public ::testing::Test {
 protected:
  std::string Place() const { return (scratch_.path() / "baked").string(); }

  void Bake() {
    manifest_ = WriteUnits(Place(), InventedKeys());
    ASSERT_TRUE(WriteManifest(Place(), manifest_));
  }
  std::shared_ptr<const Archive> OpenBaked() const {
    Result<std::shared_ptr<const Archive>> archive = Archive::Open(Place());
    EXPECT_TRUE(archive) << archive.error().message;
    return *std::move(archive);
  }

  test_support::ScratchDirectory scratch_;
  Manifest manifest_;
};

TEST_F(ArchiveTest, TilesComeBackAsTheyWereAdded) {
  Bake();
  const auto archive = OpenBaked();
  for (const geo::TileKey& key : InventedKeys()) {
    const Result<std::optional<ArchivedTile>> found = archive->Find(key);
    ASSERT_TRUE(found && *found) << geo::ToString(key);
    const tiler::EncodedTile wanted = InventedTile(key);
    EXPECT_EQ((*found)->tile.bytes, wanted.bytes);
    EXPECT_EQ(tiler::StrongETag((*found)->tile.bytes), wanted.etag);
    EXPECT_EQ((*found)->tile.max_error_m, wanted.max_error_m);
    EXPECT_EQ((*found)->tile.certified_error_m, wanted.certified_error_m);
    EXPECT_EQ((*found)->tile.vertices, wanted.vertices);
    EXPECT_EQ((*found)->tile.triangles, wanted.triangles);
    EXPECT_EQ((*found)->range.min, InventedRange(key).min);
    EXPECT_EQ(archive->FindRange(key).value()->max, InventedRange(key).max);
  }
}

TEST_F(ArchiveTest, OtherTilesAreAbsent) {
  Bake();
  const auto archive = OpenBaked();
  for (const geo::TileKey& key :
       {geo::TileKey{5, 1, 1}, {7, 100, 51}, {8, 201, 101}, {9, 0, 0}, {10, 800, 400}, {3, -1, 0}, {24, 1, 1}}) {
    const Result<std::optional<ArchivedTile>> found = archive->Find(key);
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_FALSE(*found) << geo::ToString(key);
  }
}

TEST_F(ArchiveTest, EveryTileIsVisitedOnce) {
  Bake();
  std::set<std::string> seen;
  const Result<void> read =
      OpenBaked()->ForEach([&](const geo::TileKey& key, const ArchivedTile& tile) -> Result<void> {
        EXPECT_EQ(tile.tile.bytes, InventedTile(key).bytes);
        EXPECT_TRUE(seen.insert(geo::ToString(key)).second);
        return {};
      });
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(seen.size(), InventedKeys().size());
}

TEST_F(ArchiveTest, WithoutManifestItIsUnfinished) {
  WriteUnits(Place(), InventedKeys());
  const auto archive = Archive::Open(Place());
  ASSERT_FALSE(archive);
  EXPECT_EQ(archive.error().code, ErrorCode::kNotFound);
  EXPECT_NE(archive.error().message.find("has not finished"), std::string::npos) << archive.error().message;
}

TEST_F(ArchiveTest, OtherPlacesAreRefusedWithTheReason) {
  EXPECT_EQ(Archive::Open(Place()).error().code, ErrorCode::kNotFound);
  std::filesystem::create_directories(Place());
  WriteText(Place() + "/manifest.json", R"({"name":"an application"})");
  EXPECT_EQ(Archive::Open(Place()).error().code, ErrorCode::kInvalidArgument);
  WriteText(Place() + "/other.bin", "something else");
  EXPECT_FALSE(Archive::Open(Place() + "/other.bin"));
}

TEST_F(ArchiveTest, UnitOfAnotherBakeIsNotUsed) {
  Bake();
  // The same tiles and sizes, another key.
  ASSERT_EQ(WriteUnits(Place(), InventedKeys(), 8).units.front().bytes, manifest_.units.front().bytes);
  const auto archive = OpenBaked();
  EXPECT_FALSE(archive->is_outdated());
  const auto found = archive->Find({0, 0, 0});
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(found.error().message.find("another bake"), std::string::npos);
  EXPECT_TRUE(archive->is_outdated());
}

TEST_F(ArchiveTest, MissingUnitIsAnErrorThatNamesIt) {
  Bake();
  std::filesystem::remove(Place() + "/units/7-100-50.pmtiles");
  const auto archive = OpenBaked();
  EXPECT_TRUE(archive->Find({0, 0, 0}));
  const auto found = archive->Find({7, 100, 50});
  ASSERT_FALSE(found);
  EXPECT_NE(found.error().message.find("units/7-100-50.pmtiles"), std::string::npos);
}

TEST_F(ArchiveTest, IsOutdatedWhileAFileIsLost) {
  Bake();
  const std::string unit = Place() + "/units/7-100-50.pmtiles";
  std::filesystem::rename(unit, unit + ".away");
  const auto archive = OpenBaked();
  EXPECT_TRUE(archive->is_outdated()) << "before any look-up";
  EXPECT_TRUE(archive->Find({0, 0, 0}));
  EXPECT_TRUE(archive->is_outdated());
  std::filesystem::rename(unit + ".away", unit);
  EXPECT_TRUE(archive->Find({7, 100, 50}));
  EXPECT_FALSE(archive->is_outdated());
}

TEST_F(ArchiveTest, OneLimitHoldsForTheFilesOfAllArchives) {
  Bake();
  const auto open_files = [] {
    const std::filesystem::directory_iterator files("/proc/self/fd");
    return std::distance(begin(files), end(files));
  };
  const auto before = open_files();
  dem::SetMaxIdle(2);
  std::vector<std::shared_ptr<const Archive>> archives;
  for (int i = 0; i < 5; ++i) {
    archives.push_back(OpenBaked());
    for (const geo::TileKey& key : InventedKeys()) EXPECT_TRUE(archives.back()->Find(key));
    EXPECT_EQ(open_files(), before + 2);
  }
  archives.clear();
  EXPECT_EQ(open_files(), before);
  constexpr std::size_t kDefault = 256;
  dem::SetMaxIdle(kDefault);
}

TEST_F(ArchiveTest, VerifiedUnitEqualsItsFile) {
  Bake();
  for (const UnitEntry& unit : manifest_.units) {
    const Result<FileSummary> unit_file = VerifyUnit(Place(), unit.name, {manifest_.kind, unit.key});
    ASSERT_TRUE(unit_file) << unit_file.error().message;
    EXPECT_EQ(*unit_file, (FileSummary{unit.tiles, unit.bytes, unit.xxh3}));
    const auto refused = [&](const UnitOptions& options) {
      const Result<FileSummary> other = VerifyUnit(Place(), unit.name, options);
      return !other && other.error().code == ErrorCode::kInvalidArgument;
    };
    EXPECT_TRUE(refused({manifest_.kind, unit.key + 1}));
    // With the same key: header and metadata are compared as well.
    tiler::TileRequest kind = manifest_.kind;
    kind.coding = kind.coding == tiler::Coding::kGzip ? tiler::Coding::kIdentity : tiler::Coding::kGzip;
    EXPECT_TRUE(refused({kind, unit.key}));
    kind = manifest_.kind;
    kind.format = tiler::TileFormat::kGlb;
    EXPECT_TRUE(refused({kind, unit.key}));
  }
  EXPECT_EQ(VerifyUnit(Place(), "7-1-1", {manifest_.kind, 7}).error().code, ErrorCode::kNotFound);
  // A unit's file under another unit's name.
  std::filesystem::copy_file(Place() + "/top.pmtiles", Place() + "/units/7-1-1.pmtiles");
  const std::uint64_t key = manifest_.units.front().name == "top" ? manifest_.units.front().key : 7;
  EXPECT_EQ(VerifyUnit(Place(), "7-1-1", {manifest_.kind, key}).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(ArchiveTest, TileOfAnotherUnitIsRefused) {
  const auto writer = CreateUnit(Place(), "7-100-50", {manifest_.kind, 1});
  ASSERT_TRUE(writer);
  EXPECT_FALSE((*writer)->Add({7, 101, 50}, InventedTile({7, 101, 50}), {}));
  EXPECT_FALSE((*writer)->Add({0, 0, 0}, InventedTile({0, 0, 0}), {}));
  EXPECT_FALSE(CreateUnit(Place(), "7-256-0", {manifest_.kind, 1})) << "beyond the last column";
  EXPECT_FALSE(CreateUnit(Place(), "../x", {manifest_.kind, 1}));
}

TEST_F(ArchiveTest, ArchivesOfSeveralFormatsInOnePlace) {
  for (const char* folder : {"/terrain", "/glb"}) {
    const Manifest manifest = WriteUnits(Place() + folder, InventedKeys());
    ASSERT_TRUE(WriteManifest(Place() + folder, manifest));
  }
  const auto archives = Archive::OpenAll(Place());
  ASSERT_TRUE(archives) << archives.error().message;
  EXPECT_EQ(archives->size(), 2U);
  EXPECT_EQ(Archive::OpenAll(Place() + "/glb")->size(), 1U);
  EXPECT_FALSE(Archive::OpenAll(scratch_.path().string()));
}

// Bounds of a header cannot cross the antimeridian. A viewer that goes to the centre must see the data all the same.
TEST_F(ArchiveTest, SingleFileHasItsCentreWhereItsDataAre) {
  struct {
    dem::GeoBounds dataset, header;
    double center;
  } const cases[] = {
      {{10, -33, 11, -32}, {10, -33, 11, -32}, 10.5},
      {{176, -18, -178, -16}, {-180, -18, 180, -16}, 179},  // as in Fiji
      {{179, -18, 185, -16}, {-180, -18, 180, -16}, -178},
  };
  Manifest manifest = WriteUnits(Place(), InventedKeys());
  const std::string single = (scratch_.path() / "single.pmtiles").string();
  for (const auto& [dataset, of_header, center] : cases) {
    manifest.dataset.bounds = dataset;
    ASSERT_TRUE(WriteManifest(Place(), manifest));
    ASSERT_TRUE(WriteSingle(*OpenBaked(), single));
    const auto file = PmtilesFile::Open(single);
    ASSERT_TRUE(file) << file.error().message;
    const PmtilesHeader& header = (*file)->header();
    EXPECT_NEAR(header.center_longitude, center, 1e-7);
    EXPECT_NEAR(header.bounds.west, of_header.west, 1e-7);
    EXPECT_NEAR(header.bounds.east, of_header.east, 1e-7);
  }
}

// Of a part of a dataset across the antimeridian, the rows are those of the archive's tiles.
TEST_F(ArchiveTest, BoundsOfHeightTilesAreThoseOfTheirRows) {
  Manifest manifest;
  manifest.dataset.bounds = {179, 51, -179, 52};
  manifest.available.resize(11);
  manifest.available[10] = {{0, 338, 0, 340}, {1023, 338, 1023, 340}};
  const dem::GeoBounds bounds = HeightTileBounds(manifest);
  EXPECT_EQ(bounds.west, 179);
  EXPECT_EQ(bounds.east, -179);
  EXPECT_NEAR(bounds.south, 51.3992, 1e-4);  // the southern edge of row 340 of 1,024
  EXPECT_EQ(bounds.north, 52);
}

}  // namespace
}  // namespace terrace::archive

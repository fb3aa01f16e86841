#include "tiler/store/tile_record.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "engine/tin/greedy.h"

namespace terrace::tiler {
namespace {

EncodedTile RecordTile() {
  EncodedTile tile;
  tile.bytes = std::string("a\0b", 3) + std::string(100, 'x');
  tile.etag = "\"0123\"";
  tile.max_error_m = 3.25;
  tile.certified_error_m = 9.5;
  tile.vertices = 7;
  tile.triangles = 9;
  return tile;
}

RefinedTile Refined() {
  constexpr int kCells = 8;
  dem::TileHeights heights;
  heights.lattice = {5, kCells};
  heights.stride = kCells + 3;
  heights.source_error_m = 1.5;
  for (int i = 0; i < (kCells + 3) * (kCells + 3); ++i) heights.heights.push_back(static_cast<float>(i * i % 37));
  std::vector<float> inside;
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) inside.push_back(heights.At(i, j));
  }
  const auto field = tin::HeightField::Make(kCells + 1, kCells + 1, inside);
  EXPECT_TRUE(field);
  tin::GreedyOptions options;
  options.record = true;
  tin::GreedyTriangulation greedy(*field, options);
  tin::GreedyGoal goal;
  goal.max_error = 3;
  EXPECT_TRUE(greedy.Run(goal, {}));
  return {heights, greedy.MakeRefinement(), 3};
}

TEST(TileRecord, KeepsTiles) {
  const EncodedTile tile = RecordTile();
  const auto again = ParseTile(SerializeTile(tile));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->bytes, tile.bytes);
  EXPECT_EQ(again->etag, tile.etag);
  EXPECT_EQ(again->max_error_m, tile.max_error_m);
  EXPECT_EQ(again->certified_error_m, tile.certified_error_m);
  EXPECT_EQ(again->vertices, tile.vertices);
  EXPECT_EQ(again->triangles, tile.triangles);
}

TEST(TileRecord, KeepsRefinements) {
  const RefinedTile tile = Refined();
  ASSERT_GT(tile.refinement->vertex_count(), 10u);
  const auto again = ParseRefinedTile(SerializeRefinedTile(tile));
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->error_m, tile.error_m);
  EXPECT_EQ(again->heights.lattice.level, 5);
  EXPECT_EQ(again->heights.lattice.cells, tile.heights.lattice.cells);
  EXPECT_EQ(again->heights.stride, tile.heights.stride);
  EXPECT_EQ(again->heights.source_error_m, tile.heights.source_error_m);
  EXPECT_EQ(again->heights.heights, tile.heights.heights);
  EXPECT_EQ(again->refinement, tile.refinement);
}

TEST(TileRecord, RefusesEveryOtherLength) {
  const std::string tile = SerializeTile(RecordTile()), refined = SerializeRefinedTile(Refined());
  for (std::size_t size = 0; size < tile.size(); ++size) EXPECT_FALSE(ParseTile(tile.substr(0, size))) << size;
  for (std::size_t size = 0; size < refined.size(); ++size) {
    EXPECT_FALSE(ParseRefinedTile(refined.substr(0, size))) << size;
  }
  EXPECT_FALSE(ParseTile(tile + 'x'));
  EXPECT_FALSE(ParseRefinedTile(refined + 'x'));
}

TEST(TileRecord, KeysDifferWhereverTheBytesMay) {
  std::vector<CacheKey> keys(15);
  keys[1].generation = 1;
  keys[2].request.key.level = 1;
  keys[3].request.key.x = 1;
  keys[4].request.key.y = 1;
  keys[5].request.error_step = -1;
  keys[6].request.format = TileFormat::kGlb;
  keys[7].request.compression = proto::GlbCompression::kMeshopt;
  keys[8].request.texture = proto::TextureFormat::kJpeg;
  keys[9].request.coding = Coding::kGzip;
  keys[10].request.extensions.normals = true;
  keys[11].request.extensions.water_mask = true;
  keys[12].request.extensions.metadata = true;
  keys[13].request.height_encoding = proto::HeightEncoding::kTerrarium;
  keys[14].request.side_px = 512;
  std::set<std::string> different;
  // Parameters of tiles for maps.
  for (const TileFormat format : {TileFormat::kHillshade, TileFormat::kSlope, TileFormat::kContours,
                                  TileFormat::kImagery, TileFormat::kGeodeticImagery}) {
    std::vector<CacheKey> of_map(8);
    of_map[1].request.map.picture = proto::PictureFormat::kWebp;
    of_map[2].request.map.azimuth_deg = 1;
    of_map[3].request.map.altitude_deg = 1;
    of_map[4].request.map.z_factor_hundredths = 1;
    of_map[5].request.map.slope_style = SlopeStyle::kDegrees;
    of_map[6].request.map.interval_cm = 1;
    of_map[7].edits = 1;
    std::set<std::size_t> hashes;
    for (CacheKey& key : of_map) {
      key.request.format = format;
      hashes.insert(CacheKeyHash{}(key));
    }
    EXPECT_EQ(hashes.size(), of_map.size());
    keys.insert(keys.end(), of_map.begin(), of_map.end());
  }
  for (const CacheKey& key : keys) different.insert(RecordKey(key));
  EXPECT_EQ(different.size(), keys.size());
}

TEST(TileRecord, SelectionsFindTilesOfBothSchemes) {
  TileSelection north;
  north.generation = 0;
  north.max_level = 5;
  north.box = {0, 40, 90, 80};
  const auto selects = [&](TileFormat format) {
    CacheKey key;
    key.request.format = format;
    key.request.key = {2, 2,
                       1};  // 0 to 66.5 N in Web Mercator; from 45 S to the equator in the scheme of terrain tiles
    EXPECT_EQ(IsSelected(north, key), IsSelected(north, RecordKey(key)));
    return IsSelected(north, key);
  };
  for (const TileFormat format : {TileFormat::kHeightPng, TileFormat::kHillshade, TileFormat::kSlope,
                                  TileFormat::kContours, TileFormat::kImagery}) {
    EXPECT_TRUE(selects(format));
  }
  for (const TileFormat format : {TileFormat::kQuantizedMesh, TileFormat::kGlb, TileFormat::kGeodeticImagery}) {
    EXPECT_FALSE(selects(format));
  }
}

TEST(TileRecord, KeysHoldWhileOtherDatasetsComeAndGo) {
  CacheKey key, moved;
  moved.request.dataset = 3;
  EXPECT_EQ(RecordKey(key), RecordKey(moved));
}

TEST(TileRecord, KeysOfRefinementsDiffer) {
  const std::vector<RefinedTileKey> keys = [] {
    std::vector<RefinedTileKey> made(5);
    made[1].generation = 1;
    made[2].key.level = 1;
    made[3].key.x = 1;
    made[4].key.y = 1;
    return made;
  }();
  std::set<std::string> different;
  for (const RefinedTileKey& key : keys) different.insert(RecordKey(key));
  EXPECT_EQ(different.size(), keys.size());
}

TEST(AddChecksum, FindsEveryFlippedBitAndEveryLength) {
  const std::string key = "key", value = SerializeTile(RecordTile());
  const std::string sealed = AddChecksum(key, value);
  ASSERT_EQ(StripChecksum(key, sealed), value);
  for (std::size_t bit = 0; bit < sealed.size() * 8; ++bit) {
    std::string damaged = sealed;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    EXPECT_FALSE(StripChecksum(key, damaged)) << bit;
  }
  for (std::size_t size = 0; size < sealed.size(); ++size)
    EXPECT_FALSE(StripChecksum(key, sealed.substr(0, size))) << size;
  EXPECT_FALSE(StripChecksum(key, sealed + '\0'));
}

TEST(AddChecksum, HoldsForItsKeyAlone) {
  const std::string sealed = AddChecksum("key", "value");
  EXPECT_FALSE(StripChecksum("kez", sealed));
  EXPECT_FALSE(StripChecksum("", sealed));
  EXPECT_TRUE(StripChecksum("key", sealed));
}

}  // namespace
}  // namespace terrace::tiler

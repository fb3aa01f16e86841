#include "archive/manifest.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "archive/export.h"
#include "archive/unit_name.h"
#include "tests/archive/small_archive.h"
#include "tests/support/scratch_directory.h"

namespace terrace::archive {
namespace {

Manifest FullManifest() {
  Manifest manifest;
  manifest.product = "terrace 1.0.0";
  manifest.encoder = "1 GDAL 3.6.2";
  manifest.dataset.name = "alps";
  manifest.dataset.attribution = "© swisstopo \"x\"";
  manifest.dataset.generation = 0xfedcba9876543210;
  manifest.dataset.error_fraction = 0.1;
  manifest.dataset.glb_compression = proto::GlbCompression::kMeshopt;
  manifest.dataset.bounds = {7.999583333333333, 46, 9.1, 47.3};
  manifest.dataset.heights = {-12.3456789, 4634.1};
  manifest.dataset.floor_m = 0.1;
  manifest.dataset.metadata_availability = 5;
  manifest.dataset.max_level = manifest.dataset.max_source_level = 13;
  manifest.dataset.sources = 4;
  manifest.kind.coding = tiler::Coding::kGzip;
  manifest.kind.extensions.normals = manifest.kind.extensions.metadata = true;
  manifest.error_steps = {0, -2, 4};
  manifest.max_level = 2;
  manifest.available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{4, 2, 5, 3}, {7, 0, 7, 0}}};
  manifest.identity = R"({"bbox":[1,2,3,4]})";
  manifest.units = {{"top", 0x8000000000000001, 9, 1234, "00"}, {"7-12-34", 5, 0, 0, ""}};
  return manifest;
}

TEST(ManifestTest, GoesBothWays) {
  const std::string json = ToJson(FullManifest());
  const Result<Manifest> read = ParseManifest(json);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(ToJson(*read), json);
  EXPECT_EQ(read->kind, FullManifest().kind);
  EXPECT_EQ(read->available, FullManifest().available);
  EXPECT_EQ(read->units, FullManifest().units);
  EXPECT_EQ(read->error_steps, FullManifest().error_steps);
  EXPECT_EQ(read->dataset.bounds.west, FullManifest().dataset.bounds.west);
  EXPECT_EQ(read->dataset.heights.min, FullManifest().dataset.heights.min);
}

TEST(ManifestTest, HashOfTilesIsThatOfWhatIsSent) {
  const std::uint64_t hash = TilesHash(FullManifest());
  Manifest other = FullManifest();
  other.units.clear(), other.identity = "{}", other.product = "terrace 2";
  EXPECT_EQ(TilesHash(other), hash);
  for (const auto& change : {+[](Manifest& manifest) { ++manifest.dataset.generation; },
                             +[](Manifest& manifest) { ++manifest.error_steps[1]; },
                             +[](Manifest& manifest) { manifest.kind.extensions.normals = false; },
                             +[](Manifest& manifest) { ++manifest.available[2][0].end_x; },
                             +[](Manifest& manifest) { manifest.available.pop_back(); }}) {
    other = FullManifest();
    change(other);
    EXPECT_NE(TilesHash(other), hash);
  }
}

TEST(ManifestTest, NewerFormatIsNamed) {
  std::string json = ToJson(FullManifest());
  const std::string wanted = "\"terrace_archive\": 1";
  ASSERT_NE(json.find(wanted), std::string::npos);
  json.replace(json.find(wanted), wanted.size(), "\"terrace_archive\": 2");
  const Result<Manifest> read = ParseManifest(json);
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().message.find("format 2"), std::string::npos) << read.error().message;
}

// As earlier builds wrote it.
std::string WithoutChecksum(std::string json) {
  const std::size_t at = json.find(",\n \"checksum\"");
  EXPECT_NE(at, std::string::npos);
  return json.substr(0, at) + "\n}\n";
}

TEST(ManifestTest, AnotherContentThanTheChecksumsIsRefused) {
  const std::string json = ToJson(FullManifest());
  EXPECT_TRUE(ParseManifest(WithoutChecksum(json)));
  int digits = 0;
  for (std::size_t at = 0; at < json.size(); ++at) {
    if (json[at] < '0' || json[at] > '9') continue;
    std::string changed = json;
    changed[at] = json[at] == '1' ? '2' : '1';
    const Result<Manifest> read = ParseManifest(changed);
    ASSERT_FALSE(read) << changed.substr(at > 30 ? at - 30 : 0, 60);
    digits += read.error().message.find("remove it and run the bake again") != std::string::npos;
  }
  EXPECT_GT(digits, 100);
}

// A value of two bytes takes fifty in memory.
TEST(ManifestTest, TooManyValuesAreRefused) {
  const std::string json = WithoutChecksum(ToJson(FullManifest()));
  const auto with = [&](std::size_t values) {
    std::string all = "{\"unknown\": [0";
    for (std::size_t i = 0; i < values / 2; ++i) all += ",[0]";
    return all + "]," + json.substr(json.find('{') + 1);
  };
  EXPECT_TRUE(ParseManifest(with(1'900'000)));
  for (const Result<Manifest>& read : {ParseManifest(with(2'000'000)), ManifestOf("a.pmtiles", with(2'000'000))}) {
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().message.find("it has more than 2000000 values"), std::string::npos) << read.error().message;
  }
}

// Functions of the JSON library call themselves for each level.
TEST(ManifestTest, DeepNestingIsRefused) {
  const std::string json = WithoutChecksum(ToJson(FullManifest()));
  const auto with = [&](std::size_t depth) {
    std::string deep = json;
    deep.insert(deep.find('{') + 1, "\"quote \\\"[[\": " + std::string(depth, '[') + std::string(depth, ']') + ",");
    return deep;
  };
  EXPECT_TRUE(ParseManifest(with(60)));
  for (const Result<Manifest>& read : {ParseManifest(with(300'000)), ManifestOf("a.pmtiles", with(300'000))}) {
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().message.find("nested more than 64 deep"), std::string::npos) << read.error().message;
  }
}

TEST(ManifestTest, NonsenseIsRefused) {
  const std::string json = WithoutChecksum(ToJson(FullManifest()));
  ASSERT_TRUE(ParseManifest(json));
  const auto with = [&](std::string_view from, std::string_view to) {
    std::string changed = json;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return changed.replace(at, from.size(), to);
  };
  for (const std::string& bad :
       {with("\"7-12-34\"", "\"../../etc/passwd\""), with("\"7-12-34\"", "\"top\""),
        with("\"max_level\": 2", "\"max_level\": 25"), with("\"max_level\": 2", "\"max_level\": 1"),
        with("\"min_level\": 0", "\"min_level\": 3"), with("\"error_fraction\": 0.1", "\"error_fraction\": -1"),
        with("\"gzip\"", "\"br\""), with("\"tiles\": 9", "\"tiles\": -9"), with("\"size\": 256", "\"size\": 300"),
        with("fedcba9876543210", "fedcba"), std::string(), std::string("[]"), std::string(100'000, '[')}) {
    EXPECT_FALSE(ParseManifest(bad)) << bad.substr(0, 200);
  }
}

TEST(ManifestTest, OneThatReadersRefuseIsNotWritten) {
  const test_support::ScratchDirectory scratch;
  Manifest manifest = FullManifest();
  manifest.identity = "{\"deep\": " + std::string(100, '[') + std::string(100, ']') + "}";
  EXPECT_FALSE(ParseManifest(ToJson(manifest)));
  const Result<void> written = WriteManifest(scratch.path().string(), manifest);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(ManifestTest, ASingleFileStatesRangesTwice) {
  constexpr std::size_t kLimit = 2000;
  Manifest manifest = FullManifest();
  EXPECT_TRUE(CheckSingle("out.pmtiles", manifest, kLimit));
  manifest.available.back().assign(210, {4, 2, 5, 3});
  EXPECT_TRUE(CheckManifest("out", manifest, 0, kLimit));
  EXPECT_FALSE(CheckSingle("out.pmtiles", manifest, kLimit));
}

// A bake is refused before it begins, when its units are not known but their number is.
TEST(ManifestTest, UnitsToComeCount) {
  constexpr std::size_t kLimit = 500;
  Manifest manifest = FullManifest();
  manifest.units.clear();
  std::size_t units = 0;
  while (CheckManifest("out", manifest, units, kLimit)) ++units;
  EXPECT_GT(units, 10U);
  EXPECT_LT(units, kLimit / 5);
  manifest.units.assign(units, {"7-1-2", 1, 2, 3, "00"});
  EXPECT_FALSE(CheckManifest("out", manifest, 0, kLimit));
  manifest.units.pop_back();
  EXPECT_TRUE(CheckManifest("out", manifest, 0, kLimit));
}

TEST(ManifestTest, UnitNames) {
  EXPECT_EQ(UnitNameOf({6, 127, 63}), "top");
  EXPECT_EQ(UnitNameOf({7, 255, 127}), "7-255-127");
  EXPECT_EQ(UnitNameOf({10, 2047, 1023}), "7-255-127");
  EXPECT_EQ(UnitPath("top"), "top.pmtiles");
  EXPECT_EQ(UnitPath("7-1-2"), "units/7-1-2.pmtiles");
  EXPECT_EQ(UnitRoot("7-1-2").value(), (geo::TileKey{7, 1, 2}));
  EXPECT_EQ(UnitRoot("top").value(), std::nullopt);
  for (const char* name :
       {"", "7", "7-1", "7-1-", "7-1-2-3", "8-1-2", "7-01-2", "7--1-2", "7-256-0", "7-0-128", "top/.."}) {
    EXPECT_FALSE(UnitRoot(name)) << name;
  }
}

}  // namespace
}  // namespace terrace::archive

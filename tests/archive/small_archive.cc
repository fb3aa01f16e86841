#include "tests/archive/small_archive.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <map>

#include "archive/unit_name.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::archive {

tiler::EncodedTile InventedTile(const geo::TileKey& key) {
  tiler::EncodedTile tile;
  const bool is_flat = key.level > 0 && key.y == 0;  // many tiles with the same bytes
  tile.bytes = is_flat ? "flat" : "tile " + geo::ToString(key) + std::string(static_cast<std::size_t>(key.x % 50), 'x');
  tile.etag = tiler::StrongETag(tile.bytes);
  tile.max_error_m = 0.1 * static_cast<double>(key.level + 1);
  if (key.x % 2 == 0) tile.certified_error_m = 0.3 * static_cast<double>(key.x);
  tile.vertices = static_cast<std::uint32_t>(key.x + 3);
  tile.triangles = static_cast<std::uint32_t>(key.y + 1);
  return tile;
}

dem::HeightRange InventedRange(const geo::TileKey& key) {
  return {-0.1 * static_cast<double>(key.x), 0.7 * static_cast<double>(key.y)};
}

std::vector<geo::TileKey> InventedKeys() {
  std::vector<geo::TileKey> keys;
  for (int level = 0; level <= 3; ++level) {
    for (std::int64_t y = 0; y < geo::TileRows(level); ++y) {
      for (std::int64_t x = 0; x < geo::TileColumns(level); ++x) keys.push_back({level, x, y});
    }
  }
  for (int level = 7; level <= 9; ++level) {
    const int below = level - 7;
    for (std::int64_t x = 0; x < std::int64_t{1} << below; ++x) {
      keys.push_back({level, (std::int64_t{100} << below) + x, std::int64_t{50} << below});
      keys.push_back({level, (std::int64_t{255} << below) + x, std::int64_t{127} << below});
    }
  }
  return keys;
}

Manifest WriteUnits(const std::string& place, const std::vector<geo::TileKey>& keys, std::uint64_t unit_key) {
  Manifest manifest;
  manifest.product = "terrace test";
  manifest.encoder = "1";
  manifest.dataset.name = "invented";
  manifest.dataset.generation = 0x0123456789abcdef;
  manifest.kind.coding = tiler::Coding::kGzip;
  manifest.identity = R"({"bbox":[1,2,3,4]})";
  manifest.max_level = manifest.dataset.max_level = manifest.dataset.max_source_level = 9;
  manifest.available.resize(10);
  std::map<std::string, std::unique_ptr<UnitWriter>> writers;
  for (const geo::TileKey& key : keys) {
    manifest.available[static_cast<std::size_t>(key.level)].push_back({key.x, key.y, key.x, key.y});
    std::unique_ptr<UnitWriter>& writer = writers[UnitNameOf(key)];
    if (!writer) {
      Result<std::unique_ptr<UnitWriter>> made = CreateUnit(place, UnitNameOf(key), {manifest.kind, unit_key});
      EXPECT_TRUE(made) << made.error().message;
      writer = *std::move(made);
    }
    const Result<void> added = writer->Add(key, InventedTile(key), InventedRange(key));
    EXPECT_TRUE(added) << added.error().message;
  }
  for (auto& [name, writer] : writers) {
    const Result<FileSummary> unit_file = writer->Finish();
    EXPECT_TRUE(unit_file) << unit_file.error().message;
    manifest.units.push_back({name, unit_key, unit_file->tiles, unit_file->bytes, unit_file->xxh3});
  }
  return manifest;
}

std::string FileText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void WriteText(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << text;
}

}  // namespace terrace::archive

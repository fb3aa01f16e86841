#include "bake/unit_key.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <vector>

#include "bake/bake_request.h"
#include "tests/support/source_dir.h"

namespace terrace::bake {
namespace {

constexpr auto kTerrain = tiler::TileFormat::kQuantizedMesh;
constexpr auto kGlb = tiler::TileFormat::kGlb;
constexpr auto kPng = tiler::TileFormat::kHeightPng;

// The keys of the top unit and of one below it, by format. Terrain has all extensions.
std::map<tiler::TileFormat, std::vector<std::uint64_t>> KeysOf(const tiler::Dataset& dataset) {
  BakeRequest request;
  request.formats = {kTerrain, kGlb, kPng};
  request.extensions = proto::TileExtensions{true, true, true};
  const auto manifests = PlanArchives(dataset, request, "terrace");
  EXPECT_TRUE(manifests) << manifests.error().message;
  std::map<tiler::TileFormat, std::vector<std::uint64_t>> keys;
  for (const archive::Manifest& manifest : *manifests) {
    const std::vector<Unit> units = UnitsOf(manifest.available);
    for (const Unit& unit : {units.front(), units.back()}) {
      keys[manifest.kind.format].push_back(UnitKey(dataset, manifest, unit));
    }
  }
  return keys;
}

TEST(UnitKey, DependsOnTheOptionsOfItsFormatAlone) {
  tiler::Dataset dataset;
  auto source = dem::ElevationModel::Open(test_support::SourceDir() / "config/samples/jacksboro.tif");
  ASSERT_TRUE(source) << source.error().message;
  dataset.model = *std::move(source);
  dataset.water.sea_level_m = 0;
  dataset.metadata_availability = 5;
  const auto keys = KeysOf(dataset);
  struct Change {
    std::function<void(tiler::Dataset&)> make;
    std::vector<tiler::TileFormat> changed;
  };
  const std::vector<Change> changes = {
      {[](auto& of) { of.name = "other", of.generation = 2; }, {}},
      {[](auto& of) { of.attribution = "swisstopo"; }, {kGlb}},
      {[](auto& of) { of.glb.draco.speed = 3; }, {kGlb}},
      {[](auto& of) { of.glb.draco.normal_bits = 10; }, {kGlb}},
      {[](auto& of) { of.glb.compression = proto::GlbCompression::kMeshopt; }, {kGlb}},
      {[](auto& of) { of.glb.generator = "terrace 2"; }, {kGlb}},
      {[](auto& of) { of.water.sea_level_m = 1; }, {kTerrain}},
      {[](auto& of) { of.metadata_availability = 4; }, {kTerrain}},
      {[](auto& of) { of.mesh_options.compact = true; }, {kTerrain, kGlb}},
      {[](auto& of) { of.mesh_options.criterion = tin::Criterion::kDataDependent; }, {kTerrain, kGlb}},
  };
  for (std::size_t i = 0; i < changes.size(); ++i) {
    tiler::Dataset other = dataset;
    changes[i].make(other);
    for (const auto& [format, of_format] : KeysOf(other)) {
      const bool is_changed = std::ranges::find(changes[i].changed, format) != changes[i].changed.end();
      for (std::size_t unit = 0; unit < of_format.size(); ++unit) {
        EXPECT_EQ(of_format[unit] != keys.at(format)[unit], is_changed)
            << "change " << i << ", " << archive::FolderOf(format) << ", unit " << unit;
      }
    }
  }
}

}  // namespace
}  // namespace terrace::bake

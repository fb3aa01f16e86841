// Tiles must be the same on processors with and without fused multiply-add. The C library selects its functions by the
// processor, and GLIBC_TUNABLES disables some. With another C library, or without a selection, this compares equal
// programs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/format_error_up.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/tiler/fetched_tile.h"

namespace terrace::tiler {
namespace {

// A seventh of a metre per pixel, around the western edge of a tile of level 21. The sine of its longitude is so close
// to the middle between two numbers that the two kinds of processors round it differently.
std::string WriteGround(const dem::TempDir& dir) {
  constexpr double kPixel = 0.005 / 3600, kEdge = 722781 * 180.0 / (1 << 21) - 180, kNorth = 34;
  dem::RasterSpec spec{.width = 240, .height = 240};
  spec.geo_transform = {kEdge - 120 * kPixel, kPixel, 0, kNorth, 0, -kPixel};
  spec.value = [](int column, int row) { return (column * column + 7 * row * row + column * row / 3) % 2003 * 0.25; };
  return dem::WriteRaster(dir, spec);
}

// PROJ computes the positions of a projected raster, and their last bits depend on the C library. Heights there are
// rounded to 2^-10 m, which removes the difference unless a height is close to the middle between two steps.
std::string WriteProjectedGround(const dem::TempDir& dir) {
  dem::RasterSpec spec{.width = 400, .height = 400, .crs = "EPSG:32632"};
  spec.geo_transform = {400'000, 30, 0, 5'160'000, 0, -30};
  spec.value = [](int column, int row) { return 1500 + (column * 37 + row * 91) % 211 * 0.5 + column + 2 * row; };
  return dem::WriteRaster(dir, spec, "projected.tif");
}

// Prints a hash of the bytes and the errors in the headers, for every tile, or for some of a level with many tiles.
void PrintTiles(const TilePipeline& pipeline) {
  for (std::uint32_t dataset = 0; dataset < pipeline.datasets().size(); ++dataset) {
    const dem::ElevationModel& model = *pipeline.datasets()[dataset].model;
    for (int level = 0; level <= model.max_level(); ++level) {
      for (const geo::TileKey& key : dem::SomeTiles(model, level, 12)) {
        for (const TileFormat format : {TileFormat::kQuantizedMesh, TileFormat::kGlb}) {
          TileRequest request;
          request.dataset = dataset;
          request.key = key;
          request.format = format;
          request.extensions.normals = true;
          const auto tile = pipeline.Build(request, {});
          ASSERT_TRUE(tile) << tile.error().message;
          fmt::print("tile {} {} {} {} {} {}\n", pipeline.datasets()[dataset].name, geo::ToString(key),
                     static_cast<int>(format), tile->etag, proto::FormatErrorUp(tile->max_error_m),
                     proto::FormatErrorUp(tile->certified_error_m.value_or(0)));
        }
      }
    }
  }
}

// The test below runs this in other processes.
TEST(Processor, PrintsTiles) {
  if (std::getenv("TERRACE_PRINT_TILES") == nullptr) return;
  const dem::TempDir dir;
  std::vector<Dataset> datasets;
  datasets.push_back(OpenDataset("ground", WriteGround(dir)));
  datasets.push_back(OpenDataset("projected", WriteProjectedGround(dir)));
  datasets.push_back(OpenSample("etopo5"));
  datasets.push_back(OpenSample("jacksboro"));
  PrintTiles(TilePipeline(std::move(datasets)));
}

std::vector<std::string> TilesWith(const std::string& tunables) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string command = fmt::format(
      "GLIBC_TUNABLES='{}' TERRACE_PRINT_TILES=1 '{}' --gtest_filter=Processor.PrintsTiles", tunables, program);
  FILE* const pipe = ::popen(command.c_str(), "r");
  std::vector<std::string> tiles;
  if (pipe == nullptr) return tiles;
  char line[512];
  while (std::fgets(line, sizeof line, pipe) != nullptr) {
    if (std::string text = line; text.starts_with("tile ")) tiles.push_back(std::move(text));
  }
  EXPECT_EQ(::pclose(pipe), 0) << command;
  return tiles;
}

TEST(Processor, WithoutFusedMultiplyAddMakesTheSameTiles) {
  const std::vector<std::string> with = TilesWith(""), without = TilesWith("glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4");
  ASSERT_GT(with.size(), 200u);
  ASSERT_EQ(with.size(), without.size());
  for (std::size_t i = 0; i < with.size(); ++i) EXPECT_EQ(with[i], without[i]);
}

}  // namespace
}  // namespace terrace::tiler

#include "engine/statistics/raster_chunk.h"

#include <gtest/gtest.h>

#include "engine/gdal/gdal_runtime.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

std::string WideBlocksOf(const std::string& path) {
  const auto source = OpenOrFail(path);
  return source ? source->info().sources.front().blocks_too_wide : "not opened";
}

TEST(RasterChunk, SaysWhenChunksDecodeWideBlocksAgainAndAgain) {
  const TempDir dir;
  RasterSpec spec{.width = 5000, .height = 300, .geo_transform = {10, 1e-4, 0, 46, 0, -1e-4}};
  spec.value = [](int col, int row) { return col % 7 + row % 5; };
  const std::string wide = WriteRaster(dir, spec, "wide.tif");
  spec.width = 2000;
  spec.height = 800;
  const std::string narrow = WriteRaster(dir, spec, "narrow.tif");
  EXPECT_EQ(WideBlocksOf(wide), "") << "the blocks fit into the cache";
  SetGdalCache(4 << 20);
  const std::string advice = WideBlocksOf(wide);
  EXPECT_NE(advice.find("decodes each of them 5 times"), std::string::npos) << advice;
  EXPECT_NE(advice.find("at least 6 MiB (it is 4 MiB)"), std::string::npos) << advice;
  EXPECT_NE(advice.find("TILED=YES"), std::string::npos) << advice;
  EXPECT_EQ(WideBlocksOf(narrow), "");
  SetGdalCache(256 << 20);
}

}  // namespace
}  // namespace terrace::dem

#include "tests/support/test_data.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <memory>

#include "tests/support/source_dir.h"

namespace terrace::test_support {
namespace {

std::filesystem::path Folder() {
  if (const char* named = std::getenv("TERRACE_TEST_DATA"); named != nullptr && *named != '\0') return named;
  return SourceDir() / ".." / "shared" / "data";
}

}  // namespace

std::optional<std::string> TestDataPath(std::string_view name) {
  const std::filesystem::path path = Folder() / name;
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return std::nullopt;
  return path.string();
}

std::string MissingTestData(std::string_view name) {
  return fmt::format("SKIPPED FOR WANT OF DATA: {} is not in {}; set TERRACE_TEST_DATA to the folder that has it", name,
                     Folder().string());
}

std::optional<TestRaster> ReadTestRaster(std::string_view name, int x, int y, int width, int height) {
  const std::optional<std::string> path = TestDataPath(name);
  if (!path) return std::nullopt;
  GDALAllRegister();
  const std::unique_ptr<GDALDataset> dataset(GDALDataset::Open(path->c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY));
  if (!dataset || dataset->GetRasterCount() < 1) return std::nullopt;
  if (width == 0) width = dataset->GetRasterXSize() - x;
  if (height == 0) height = dataset->GetRasterYSize() - y;

  TestRaster raster{width, height,
                    std::vector<float>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
  GDALRasterBand* band = dataset->GetRasterBand(1);
  if (band->RasterIO(GF_Read, x, y, width, height, raster.heights.data(), width, height, GDT_Float32, 0, 0) !=
      CE_None) {
    return std::nullopt;
  }
  int has_nodata = 0;
  const auto nodata = static_cast<float>(band->GetNoDataValue(&has_nodata));
  if (has_nodata != 0) {
    for (float& value : raster.heights) {
      if (value == nodata) value = std::numeric_limits<float>::quiet_NaN();
    }
  }
  return raster;
}

}  // namespace terrace::test_support

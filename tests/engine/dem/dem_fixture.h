// Rasters for the tests: real ones from the folder TERRACE_TEST_DATA, and small synthetic ones.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/dem/elevation_model.h"

namespace terrace::dem {

// A temporary folder; the destructor removes it.
class TempDir {
 public:
  TempDir();
  ~TempDir();
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  std::string File(const std::string& name) const { return (path_ / name).string(); }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct RasterSpec {
  int width = 16, height = 16;
  std::string type = "Float32";
  std::array<double, 6> geo_transform = {0, 1, 0, 0, 0, -1};
  bool georeferenced = true;
  std::string crs = "EPSG:4326";  // empty: none
  std::optional<double> nodata = {};
  std::string unit = {};
  double scale = 1, offset = 0;
  std::vector<int> overviews = {};
  // Raw value by column and row.
  std::function<double(int, int)> value = [](int, int) { return 0.0; };
};

// A square of `side` pixels of one height; west, north and pixel in degrees.
RasterSpec FlatSquare(double west, double north, int side, double pixel, double height);

// Writes a GeoTIFF and returns its path.
std::string WriteRaster(const TempDir& dir, const RasterSpec& spec, const std::string& name = "dem.tif");

// Writes a VRT that contains one raster. Precondition: the source policy allows VRTs.
void WriteVrt(const std::string& part, const std::string& path);

// A file of the test data folder; nothing and a message if it is missing.
std::optional<std::string> TestDataFile(const std::string& name);

// Opens a model. On failure the test fails and the result is null.
std::unique_ptr<ElevationModel> OpenOrFail(const std::string& path, const DemOptions& options = {});
std::unique_ptr<ElevationModel> OpenOrFail(const std::vector<DemFile>& files, const DemOptions& options = {});

// The available ranges of a level that touch the source's bounds; the others exist only because a tile has four
// children. All of them if the bounds cross the antimeridian.
std::vector<geo::TileRange> TilesWithData(const ElevationModel& model, int level);

// A cache with statistics in this folder without a bound, and no averages in memory.
RasterCache CacheIn(const std::string& folder);

// About `count` tiles, distributed over the available ones.
std::vector<geo::TileKey> SomeTiles(const ElevationModel& model, int level, int count);

// File names of one real raster for every kind of CRS.
std::vector<std::string> RealRasters();

}  // namespace terrace::dem

#define TERRACE_REQUIRE_DATA(variable, name)                                                                    \
  const std::optional<std::string> variable##_found = ::terrace::dem::TestDataFile(name);                       \
  if (!variable##_found) GTEST_SKIP() << "SKIPPED, test data missing: " << (name) << "; set TERRACE_TEST_DATA"; \
  const std::string& variable = *variable##_found

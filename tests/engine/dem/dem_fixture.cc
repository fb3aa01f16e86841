#include "tests/engine/dem/dem_fixture.h"

#include <gdal_priv.h>
#include <ogr_spatialref.h>
#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include "engine/geo/tile_cover.h"
#include "engine/statistics/cache_folder.h"
#include "tests/support/source_dir.h"

namespace terrace::dem {

TempDir::TempDir() {
  std::string pattern = (std::filesystem::temp_directory_path() / "terrace_dem_XXXXXX").string();
  path_ = ::mkdtemp(pattern.data());
}
TempDir::~TempDir() { std::filesystem::remove_all(path_); }

RasterSpec FlatSquare(double west, double north, int side, double pixel, double height) {
  RasterSpec spec;
  spec.width = spec.height = side;
  spec.geo_transform = {west, pixel, 0, north, 0, -pixel};
  spec.value = [height](int, int) { return height; };
  return spec;
}

std::string WriteRaster(const TempDir& dir, const RasterSpec& spec, const std::string& name) {
  GDALAllRegister();
  const std::string path = dir.File(name);
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  const GDALDataType type = GDALGetDataTypeByName(spec.type.c_str());
  GDALDatasetUniquePtr dataset(driver->Create(path.c_str(), spec.width, spec.height, 1, type, nullptr));
  if (spec.georeferenced) {
    std::array<double, 6> transform = spec.geo_transform;
    dataset->SetGeoTransform(transform.data());
  }
  if (!spec.crs.empty()) {
    OGRSpatialReference srs;
    EXPECT_EQ(srs.SetFromUserInput(spec.crs.c_str()), OGRERR_NONE);
    srs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    dataset->SetSpatialRef(&srs);
  }
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  if (spec.nodata) band.SetNoDataValue(*spec.nodata);
  if (!spec.unit.empty()) band.SetUnitType(spec.unit.c_str());
  if (spec.scale != 1) band.SetScale(spec.scale);
  if (spec.offset != 0) band.SetOffset(spec.offset);
  std::vector<double> line(static_cast<std::size_t>(spec.width));
  for (int row = 0; row < spec.height; ++row) {
    for (int col = 0; col < spec.width; ++col) line[static_cast<std::size_t>(col)] = spec.value(col, row);
    EXPECT_EQ(band.RasterIO(GF_Write, 0, row, spec.width, 1, line.data(), spec.width, 1, GDT_Float64, 0, 0, nullptr),
              CE_None);
  }
  std::vector<int> overviews = spec.overviews;
  if (!overviews.empty()) {
    dataset->FlushCache(false);
    EXPECT_EQ(dataset->BuildOverviews("AVERAGE", static_cast<int>(overviews.size()), overviews.data(), 0, nullptr,
                                      GDALDummyProgress, nullptr),
              CE_None);
  }
  return path;
}

void WriteVrt(const std::string& part, const std::string& path) {
  const GDALDatasetUniquePtr from(GDALDataset::Open(part.c_str()));
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("VRT");
  const GDALDatasetUniquePtr written(driver->CreateCopy(path.c_str(), from.get(), FALSE, nullptr, nullptr, nullptr));
  EXPECT_NE(written, nullptr);
}

std::optional<std::string> TestDataFile(const std::string& name) {
  const char* folder = std::getenv("TERRACE_TEST_DATA");
  const std::filesystem::path path =
      (folder != nullptr ? std::filesystem::path(folder) : test_support::SourceDir() / "../shared/data") / name;
  if (std::filesystem::exists(path)) return path.string();
  std::cerr << "test data missing: " << path << "; set TERRACE_TEST_DATA\n";
  return std::nullopt;
}

std::unique_ptr<ElevationModel> OpenOrFail(const std::string& path, const DemOptions& options) {
  auto source = ElevationModel::Open(path, options);
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

std::unique_ptr<ElevationModel> OpenOrFail(const std::vector<DemFile>& files, const DemOptions& options) {
  auto source = ElevationModel::Open(files, options);
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

std::vector<geo::TileRange> TilesWithData(const ElevationModel& model, int level) {
  const GeoBounds& bounds = model.info().bounds;
  if (bounds.west > bounds.east) return model.Available(level);
  const auto tile = [level](double degrees) { return static_cast<std::int64_t>(std::ldexp(degrees / 180, level)); };
  const geo::TileRange box{tile(bounds.west + 180), tile(bounds.south + 90), tile(bounds.east + 180),
                           tile(bounds.north + 90)};
  std::vector<geo::TileRange> ranges;
  for (const geo::TileRange& range : model.Available(level)) {
    if (const auto common = geo::Intersection(range, box); !geo::IsEmpty(common)) ranges.push_back(common);
  }
  return ranges;
}

std::vector<geo::TileKey> SomeTiles(const ElevationModel& model, int level, int count) {
  std::vector<geo::TileKey> keys;
  for (const geo::TileRange& range : TilesWithData(model, level)) {
    const std::int64_t columns = range.end_x - range.start_x + 1, rows = range.end_y - range.start_y + 1;
    const std::int64_t wanted = std::min<std::int64_t>(columns * rows, count);
    for (std::int64_t i = 0; i < wanted; ++i) {
      const std::int64_t at = i * (columns * rows) / wanted;
      keys.push_back({level, range.start_x + at % columns, range.start_y + at / columns});
    }
  }
  return keys;
}

std::vector<std::string> RealRasters() {
  return {"srtm3_N46E008_swiss_alps.tif",
          "antimeridian_hawaii_topobathy_5min.tif",
          "etopo1_global_1deg_float32.tif",
          "etopo5_global_10min.tif",
          "bigtujunga_30m_utm11.tif",
          "greenland_80N_100m_custom_tm.tif",
          "lidar_slovenia_1m_nodata.tif",
          "ortho_pair_dtm_2m_byte.tif",
          "pole_antarctica_bedmap_5km.tif",
          "webmercator_sf_float32.tif",
          "SainteHelens.dem",
          "n43e007.dt0"};
}

RasterCache CacheIn(const std::string& folder) { return {std::make_shared<CacheFolder>(folder), nullptr}; }

}  // namespace terrace::dem

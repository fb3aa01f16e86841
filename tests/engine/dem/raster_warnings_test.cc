// Rasters whose position, unit or datum is probably not what their owner means, and damage that GDAL hides.
#include "engine/sources/raster_warnings.h"

#include <cpl_conv.h>
#include <gdal_priv.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "engine/gdal/driver_list.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"
#include "engine/gdal/source_policy.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/source_fixture.h"

namespace terrace::dem {
namespace {

// Without the one that all rasters without a vertical datum have.
std::vector<std::string> WarningsAbout(const std::string& path, const SourceOptions& options = {}) {
  auto raster = RasterSource::Open(path, options);
  EXPECT_TRUE(raster.has_value()) << raster.error().message;
  std::vector<std::string> warnings;
  if (raster) warnings = (*raster)->info().warnings;
  std::erase_if(warnings, [](const std::string& warning) { return warning.starts_with("no vertical datum stated:"); });
  return warnings;
}

void ExpectOne(const std::vector<std::string>& warnings, const std::string& part) {
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings.front().find(part), std::string::npos) << warnings.front();
}

TEST(RasterWarnings, AreAbsentForUsualRasters) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {7, .01, 0, 46, 0, -.01}};
  EXPECT_EQ(WarningsAbout(WriteRaster(dir, spec)), std::vector<std::string>());
  spec = {.width = 37, .height = 19, .geo_transform = {-185, 10, 0, 95, 0, -10}};  // nodes at the poles
  EXPECT_EQ(WarningsAbout(WriteRaster(dir, spec)), std::vector<std::string>());
  spec = {.geo_transform = {0, 10, 0, 100, 0, -10}, .crs = "EPSG:32632"};  // near the origin of the system
  EXPECT_EQ(WarningsAbout(WriteRaster(dir, spec)), std::vector<std::string>());
}

TEST(RasterWarnings, NameRowsAndColumnsThatAreNotRead) {
  const TempDir dir;
  ExpectOne(WarningsAbout(WriteRaster(dir, {.width = 20, .height = 120, .geo_transform = {7, 1, 0, 110, 0, -1}})),
            "beyond a pole, to latitude 110");
  ExpectOne(WarningsAbout(WriteRaster(dir, {.width = 400, .height = 20, .geo_transform = {-180, 1, 0, 10, 0, -1}})),
            "its last 40 columns");
}

TEST(RasterWarnings, NameProjectedRastersInDegrees) {
  const TempDir dir;
  ExpectOne(WarningsAbout(WriteRaster(dir, {.geo_transform = {7, .001, 0, 46, 0, -.001}, .crs = "EPSG:32632"})),
            "if its coordinates are degrees");
}

TEST(RasterWarnings, ContainTheWarningsOfGdal) {
  InitGdal();
  TakeGdalWarnings();
  for (const char* const text : {"first", "second", "first"}) CPLError(CE_Warning, CPLE_AppDefined, "%s", text);
  EXPECT_EQ(TakeGdalWarnings(), (std::vector<std::string>{"first", "second"}));
  EXPECT_TRUE(TakeGdalWarnings().empty());
  // A file whose dimensions are longitude and latitude, instead of latitude and longitude.
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("netCDF");
  ASSERT_NE(driver, nullptr);
  const TempDir dir;
  const std::string path = dir.File("turned.nc");
  {
    const std::unique_ptr<GDALDataset> file(driver->CreateMultiDimensional(path.c_str(), nullptr, nullptr));
    ASSERT_NE(file, nullptr);
    const std::shared_ptr<GDALGroup> root = file->GetRootGroup();
    const auto type = GDALExtendedDataType::Create(GDT_Float64);
    const GUInt64 begin[] = {0, 0};
    const std::size_t size[] = {20, 20};
    std::vector<std::shared_ptr<GDALDimension>> dimensions;
    for (const auto& [name, units, first] : {std::tuple("lon", "degrees_east", 7.0), {"lat", "degrees_north", 46.0}}) {
      dimensions.push_back(root->CreateDimension(name, "", "", 20));
      const auto axis = root->CreateMDArray(name, {dimensions.back()}, type);
      std::vector<double> values(20);
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = first + .01 * static_cast<double>(i);
      axis->Write(begin, size, nullptr, nullptr, type, values.data());
      axis->CreateAttribute("units", {}, GDALExtendedDataType::CreateString())->Write(units);
    }
    const auto heights = root->CreateMDArray("z", dimensions, type);
    const std::vector<double> values(400, 500.0);
    heights->Write(begin, size, nullptr, nullptr, type, values.data());
    OGRSpatialReference srs;
    srs.SetFromUserInput("EPSG:4326");
    heights->SetSpatialRef(&srs);
  }
  const std::vector<std::string> warnings = WarningsAbout(path);
  EXPECT_TRUE(std::ranges::any_of(warnings, [](const std::string& warning) {
    return warning.starts_with("GDAL warns: ") && warning.find("not a Longitude/X dimension") != std::string::npos;
  }));
}

// A description beside the file may say that x is the latitude.
TEST(RasterWarnings, AreNotNeededWhereTheFileStatesTheOrderOfItsAxes) {
  const TempDir dir;
  RasterSpec spec{.width = 30, .height = 20, .geo_transform = {46, .01, 0, 7, 0, .01}, .crs = ""};
  spec.value = [](int column, int row) { return 100.0 * column + row; };
  const std::string path = WriteRaster(dir, spec);
  std::ofstream(path + ".aux.xml") << R"(<PAMDataset><SRS dataAxisToSRSAxisMapping="1,2">EPSG:4326</SRS></PAMDataset>)";
  const auto model = OpenOrFail(path);
  ASSERT_NE(model, nullptr);
  const GeoBounds bounds = model->info().bounds;
  EXPECT_NEAR(bounds.west, 7, 1e-9);
  EXPECT_NEAR(bounds.north, 46.3, 1e-9);
  const std::vector<GeoPosition> points = {{7.055, 46.035}};  // row 5, column 3
  const auto heights = model->ReadPoints(points);
  ASSERT_TRUE(heights);
  EXPECT_NEAR(heights->front(), 305, 1e-3);
}

TEST(RasterWarnings, NameDepths) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {7, .01, 0, 46, 0, -.01}};
  spec.crs = "EPSG:4326+6357";
  const std::string path = WriteRaster(dir, spec);
  const auto refused = RasterSource::Open(path);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("NAVD88 depth counts downwards; make heights of the depths"),
            std::string::npos)
      << refused.error().message;
  EXPECT_EQ(refused.error().message.find("or let `vertical`"), std::string::npos) << refused.error().message;
  ExpectOne(WarningsAbout(path, {.vertical = "ellipsoid"}), "has depths (NAVD88 depth)");
}

// The British National Grid beyond Britain.
TEST(RasterWarnings, SystemsThatCannotBeConvertedExactlyAreNamed) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {1'500'000, 100, 0, 300'000, 0, -100}, .crs = "EPSG:27700"};
  ExpectOne(WarningsAbout(WriteRaster(dir, spec), {.vertical = "ellipsoid"}), "PROJ knows no exact way from OSGB36");
  spec.geo_transform = {400'000, 100, 0, 300'000, 0, -100};
  EXPECT_EQ(WarningsAbout(WriteRaster(dir, spec), {.vertical = "ellipsoid"}), std::vector<std::string>());
}

// Writes a netCDF file of heights at these latitudes, half a degree apart from west to east. `positive`, `quantity`:
// attributes; null: none.
std::string WriteNetCdf(const TempDir& dir, const std::vector<double>& latitudes, const char* positive = nullptr,
                        const char* quantity = nullptr) {
  OpenRaster("none");  // registers the drivers
  constexpr std::size_t kColumns = 20;
  const std::string path = (dir.path() / "grid.nc").string();
  const std::unique_ptr<GDALDataset> file(
      GetGDALDriverManager()->GetDriverByName("netCDF")->CreateMultiDimensional(path.c_str(), nullptr, nullptr));
  const auto root = file->GetRootGroup();
  const auto put = [](GDALMDArray& array, const char* name, const std::string& value) {
    array.CreateAttribute(name, {}, GDALExtendedDataType::CreateString(0), nullptr)->Write(value.c_str());
  };
  const auto real = GDALExtendedDataType::Create(GDT_Float64);
  const auto add = [&](const char* name, const std::vector<std::shared_ptr<GDALDimension>>& sides,
                       const std::vector<double>& values, const char* unit) {
    const auto array = root->CreateMDArray(name, sides, real, nullptr);
    std::vector<GUInt64> begin(sides.size(), 0);
    std::vector<std::size_t> count;
    for (const auto& side : sides) count.push_back(side->GetSize());
    EXPECT_TRUE(array->Write(begin.data(), count.data(), nullptr, nullptr, real, values.data()));
    put(*array, "units", unit);
    return array;
  };
  const auto rows = root->CreateDimension("lat", "", "", latitudes.size());
  const auto columns = root->CreateDimension("lon", "", "", kColumns);
  std::vector<double> longitudes, heights;
  for (std::size_t i = 0; i < kColumns; ++i) longitudes.push_back(5 + 0.5 * static_cast<double>(i));
  for (std::size_t i = 0; i < kColumns * latitudes.size(); ++i) heights.push_back(static_cast<double>(i % 900));
  put(*add("lat", {rows}, latitudes, "degrees_north"), "standard_name", "latitude");
  put(*add("lon", {columns}, longitudes, "degrees_east"), "standard_name", "longitude");
  const auto z = add("z", {rows, columns}, heights, "m");
  const auto crs = root->CreateMDArray("crs", {}, GDALExtendedDataType::Create(GDT_Int32), nullptr);
  put(*crs, "grid_mapping_name", "latitude_longitude");
  put(*z, "grid_mapping", "crs");
  if (positive != nullptr) put(*z, "positive", positive);
  if (quantity != nullptr) put(*z, "standard_name", quantity);
  return path;
}

std::vector<double> Latitudes(int rows, double bend) {
  std::vector<double> latitudes;
  for (int row = 0; row < rows; ++row) latitudes.push_back(60 - 0.5 * row - bend * std::sin(0.2 * row));
  return latitudes;
}

TEST(RasterWarnings, RowsThatAreNotEvenlySpacedAreRefused) {
  const TempDir dir;
  const auto refused = RasterSource::Open(WriteNetCdf(dir, Latitudes(40, 0.2)));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().message.find("its rows are not evenly spaced: row "), std::string::npos)
      << refused.error().message;
  std::vector<double> upwards = Latitudes(40, 0.2);
  std::ranges::reverse(upwards);
  EXPECT_FALSE(RasterSource::Open(WriteNetCdf(dir, upwards)));
  EXPECT_EQ(WarningsAbout(WriteNetCdf(dir, Latitudes(40, 0))), std::vector<std::string>());
  // Latitudes in single precision.
  for (double step : {1.0, 1.0 / 120, 1.0 / 1200}) {
    std::vector<double> latitudes;
    for (int row = 0; row < 40; ++row) latitudes.push_back(static_cast<float>(80 - step * row));
    EXPECT_EQ(WarningsAbout(WriteNetCdf(dir, latitudes)), std::vector<std::string>()) << step;
  }
}

TEST(RasterWarnings, BandsThatStateDepthsAreRefused) {
  const TempDir dir;
  const std::string path = WriteNetCdf(dir, Latitudes(40, 0), "down");
  const auto refused = RasterSource::Open(path);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("its samples are depths; make heights of them"), std::string::npos)
      << refused.error().message;
  ExpectOne(WarningsAbout(path, {.vertical = "ellipsoid"}), "its band states \"positive: down\"");
  EXPECT_TRUE(RasterSource::Open(WriteNetCdf(dir, Latitudes(40, 0), "up")));
  const auto of_quantity = [&](const char* positive, const char* quantity) {
    return static_cast<bool>(RasterSource::Open(WriteNetCdf(dir, Latitudes(40, 0), positive, quantity)));
  };
  EXPECT_FALSE(of_quantity(nullptr, "sea_floor_depth_below_geoid"));
  EXPECT_FALSE(of_quantity(nullptr, "depth"));
  EXPECT_FALSE(of_quantity(nullptr, "depth_below_geoid"));
  EXPECT_TRUE(of_quantity("up", "sea_floor_depth_below_geoid"));
  EXPECT_TRUE(of_quantity(nullptr, "surface_altitude"));
}

// Tools copy the header of a DTED file into the metadata of GeoTIFFs.
TEST(RasterWarnings, NameTheDatumOfADtedHeader) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {.geo_transform = {7, .01, 0, 46, 0, -.01}});
  GDALDatasetUniquePtr(GDALDataset::Open(path.c_str(), GDAL_OF_UPDATE))->SetMetadataItem("DTED_VerticalDatum", "E96");
  ExpectOne(WarningsAbout(path), "no vertical datum stated (the file states DTED_VerticalDatum=E96;");
  EXPECT_EQ(WarningsAbout(path, {.vertical = "egm96"}), std::vector<std::string>());
}

TEST(RasterWarnings, UnitsWithNumbersOrWithoutLettersAreNotKnown) {
  for (const char* const unit : {"0.1 m", "10 m", "1/10 metre", "%", "[-]", "\u00b0"})
    EXPECT_EQ(MetresPerUnit(unit), std::nullopt) << unit;
  EXPECT_EQ(MetresPerUnit("centimeters"), .01);
  EXPECT_EQ(MetresPerUnit("Decimetres"), .1);
  const TempDir dir;
  RasterSpec spec{.geo_transform = {7, .01, 0, 46, 0, -.01}, .unit = "furlongs"};
  spec.value = [](int, int) { return 1e6; };
  const auto refused = ElevationModel::Open(WriteRaster(dir, spec));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("unit \"furlongs\" is not known"), std::string::npos)
      << refused.error().message;
}

// GDAL's driver for GeoPackages reports a tile that it cannot decode, and returns success with zeros.
TEST(DamagedBlocks, AreErrorsAlsoIfGdalReturnsZeros) {
  InitGdal();
  GDALDriver* const driver = FindDriver("GPKG");
  ASSERT_NE(driver, nullptr);
  const TempDir dir;
  RasterSpec spec{.width = 256, .height = 256, .type = "Byte", .geo_transform = {7, .001, 0, 46, 0, -.001}};
  spec.value = [](int column, int row) { return 50 + (column * 7 + row * 3) % 100; };
  const std::string path = dir.File("tiles.gpkg");
  const struct Restored {
    ~Restored() { EXPECT_TRUE(UseDrivers(DefaultDrivers())); }
  } restored;
  ASSERT_TRUE(UseDrivers({"GTiff", "GPKG", "PNG"}));
  {
    const GDALDatasetUniquePtr source(GDALDataset::Open(WriteRaster(dir, spec).c_str()));
    const char* const options[] = {"TILE_FORMAT=PNG", nullptr};
    const GDALDatasetUniquePtr copy(
        driver->CreateCopy(path.c_str(), source.get(), FALSE, const_cast<char**>(options), nullptr, nullptr));
    ASSERT_NE(copy, nullptr);
  }
  EXPECT_TRUE(RasterSource::Open(path));
  std::string bytes = (std::stringstream() << std::ifstream(path, std::ios::binary).rdbuf()).str();
  for (std::size_t at = bytes.find("IDAT"); at != std::string::npos; at = bytes.find("IDAT", at + 1)) bytes[at] = 'X';
  std::ofstream(path, std::ios::binary) << bytes;
  const GDALDatasetUniquePtr file(GDALDataset::Open(path.c_str()));
  ASSERT_NE(file, nullptr);
  std::vector<float> heights(16);
  for (int i = 0; i < 2; ++i) {  // not from a cache of blocks
    EXPECT_FALSE(ReadRaw(*file->GetRasterBand(1), 0, 0, 4, 4, GDT_Float32, heights.data())) << i;
  }
  const auto damaged = RasterSource::Open(path);
  ASSERT_FALSE(damaged);
  EXPECT_NE(damaged.error().message.find("cannot be read"), std::string::npos) << damaged.error().message;
}

// GDAL reports what is wrong with a part of a VRT when it first reads from it, and reads it all the same.
TEST(DamagedBlocks, AreNotThoseOfPartsWithOddSidecars) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {7, .01, 0, 46, 0, -.01}};
  spec.value = [](int, int) { return 77; };
  const std::string part = dir.File("part.asc"), vrt = dir.File("all.vrt");
  {
    const GDALDatasetUniquePtr source(GDALDataset::Open(WriteRaster(dir, spec).c_str()));
    GDALDatasetUniquePtr(
        FindDriver("AAIGrid")->CreateCopy(part.c_str(), source.get(), FALSE, nullptr, nullptr, nullptr));
  }
  ASSERT_TRUE(AllowVrts());
  WriteVrt(part, vrt);
  const GDALDatasetUniquePtr file(GDALDataset::Open(vrt.c_str()));
  ASSERT_NE(file, nullptr);
  std::ofstream(dir.File("part.prj")) << "GEOGCS[\"broken";
  std::vector<float> heights(16);
  EXPECT_TRUE(ReadRaw(*file->GetRasterBand(1), 0, 0, 4, 4, GDT_Float32, heights.data())) << TakeGdalError();
  EXPECT_TRUE(HasGdalError()) << "the test needs a sidecar of which GDAL reports an error";
  EXPECT_EQ(heights.front(), 77);
}

// Of a header whose name has another case than the raster's.
TEST(SidecarsOfAnotherCase, AreFound) {
  const TempDir dir;
  RasterSpec spec{.type = "Int16", .geo_transform = {7, .01, 0, 46, 0, -.01}};
  spec.value = [](int, int) { return 321; };
  const GDALDatasetUniquePtr source(GDALDataset::Open(WriteRaster(dir, spec).c_str()));
  const std::string path = dir.File("heights.bil");
  GDALDatasetUniquePtr(FindDriver("EHdr")->CreateCopy(path.c_str(), source.get(), FALSE, nullptr, nullptr, nullptr));
  std::filesystem::rename(dir.File("heights.hdr"), dir.File("heights.HDR"));
  const auto raster = RasterSource::Open(path);
  ASSERT_TRUE(raster) << raster.error().message;
  EXPECT_EQ((*raster)->info().heights.max, 321);
}

}  // namespace
}  // namespace terrace::dem

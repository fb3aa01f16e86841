// Sampling of synthetic rasters whose heights are known.
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

// A plane over longitude and latitude, sampled at pixel centres.
RasterSpec PlaneSpec(double west, double north, double step, int width, int height) {
  RasterSpec spec{
      .width = width, .height = height, .type = "Float64", .geo_transform = {west, step, 0, north, 0, -step}};
  spec.value = [=](int col, int row) { return 100 * (west + (col + .5) * step) - 30 * (north - (row + .5) * step); };
  return spec;
}

TEST(Resampling, ReproducesAPlane) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, PlaneSpec(10, 20, .01, 400, 300)), {.floor = -9});
  int inside = 0;
  for (int level = 4; level <= source->max_level(); ++level) {  // averaging included
    for (const geo::TileKey& key : SomeTiles(*source, level, 6)) {
      const auto tile = source->Read(key);
      ASSERT_TRUE(tile);
      const double margin = std::max(.02, 2 * tile->lattice.StepDegrees());
      for (int j = -1; j <= tile->lattice.cells + 1; ++j) {
        for (int i = -1; i <= tile->lattice.cells + 1; ++i) {
          const double x = tile->lattice.Longitude(tile->lattice.FirstColumn(key) + i);
          const double y = tile->lattice.Latitude(tile->lattice.FirstRow(key) + j);
          if (x < 10 + margin || x > 14 - margin || y > 20 - margin || y < 17 + margin) continue;
          ASSERT_NEAR(tile->At(i, j), 100 * x - 30 * y, .0006) << geo::ToString(key);
          ++inside;
        }
      }
    }
  }
  EXPECT_GT(inside, 10000);
}

// A window with a peak is interpolated, one of equal samples is not.
TEST(Resampling, LevelGroundDoesNotDependOnTheWindow) {
  for (const double height : {12.3457, -3.3, 0.0, -0.0}) {
    const TempDir dir;
    RasterSpec spec = FlatSquare(10, 50, 200, .01, height);
    spec.value = [height](int column, int row) { return column == 150 && row == 150 ? 80 : height; };
    const auto source = OpenOrFail(WriteRaster(dir, spec));
    const int level = source->max_level();
    const double step = source->LatticeOf(level).StepDegrees();
    const auto node = [step](double degrees) { return std::llround(degrees / step); };
    const NodeWindow level_ground{node(190.5), node(139.5), 20, 20};
    const int beyond = static_cast<int>(node(1.2));
    const NodeWindow with_peak{level_ground.column, level_ground.row - beyond, beyond, beyond + 20};
    const auto some = source->ReadNodes(level, level_ground), all = source->ReadNodes(level, with_peak);
    ASSERT_TRUE(some && all);
    EXPECT_GT(*std::ranges::max_element(*all), height + 1);
    for (int j = 0; j < 20; ++j) {
      for (int i = 0; i < 20; ++i) {
        const float here = (*some)[static_cast<std::size_t>(j * 20 + i)];
        const float there = (*all)[static_cast<std::size_t>((j + beyond) * beyond + i)];
        ASSERT_EQ(std::bit_cast<std::uint32_t>(here), std::bit_cast<std::uint32_t>(there)) << height;
      }
    }
  }
}

TEST(Resampling, EndsHalfAPixelBeyondTheOutermostCentres) {
  const TempDir dir;
  RasterSpec spec{.width = 16, .height = 16, .geo_transform = {0, 1, 0, 16, 0, -1}};
  spec.value = [](int, int) { return 50.0; };
  const auto source = OpenOrFail(WriteRaster(dir, spec), {.floor = -1});
  const geo::TileKey key{4, 16, 8};  // west edge on 0, south edge on 0
  const auto tile = source->Read(key);
  ASSERT_TRUE(tile);
  EXPECT_EQ(tile->At(-1, 5), -1);
  EXPECT_EQ(tile->At(5, -1), -1);
  EXPECT_EQ(tile->At(0, 0), 50);
  EXPECT_EQ(tile->At(3, 3), 50);
}

TEST(Resampling, GlobalSourcesWrap) {
  const TempDir dir;
  // One raster registered at nodes with a duplicate column, one at pixels, both with one degree.
  RasterSpec nodes{.width = 361, .height = 181, .geo_transform = {-180.5, 1, 0, 90.5, 0, -1}};
  nodes.value = [](int col, int) { return 1000 * std::cos((col - 180) * .0174532925199433); };
  RasterSpec pixels{.width = 360, .height = 180, .geo_transform = {0, 1, 0, 90, 0, -1}};
  pixels.value = [](int col, int) { return 1000 * std::cos((col + .5) * .0174532925199433); };
  int index = 0;
  for (const RasterSpec& spec : {nodes, pixels}) {
    SCOPED_TRACE(index);
    const auto source = OpenOrFail(WriteRaster(dir, spec, std::to_string(index++) + ".tif"), {.floor = 5000});
    const int level = 3;
    for (std::int64_t x = 0; x < geo::TileColumns(level); ++x) {
      const auto tile = source->Read({level, x, 4});
      ASSERT_TRUE(tile);
      for (int i = -1; i <= tile->lattice.cells + 1; ++i) {
        const double longitude = tile->lattice.Longitude(x * tile->lattice.cells + i);
        ASSERT_NEAR(tile->At(i, 9), 1000 * std::cos(longitude * .0174532925199433), .2) << longitude;
      }
    }
  }
}

TEST(Resampling, PolesOfGlobalSourcesAreTheMeanOfTheirRow) {
  const TempDir dir;
  RasterSpec spec{.width = 360, .height = 181, .geo_transform = {-180, 1, 0, 90.5, 0, -1}};
  spec.value = [](int col, int row) { return row == 0 ? col % 2 * 10.0 : row == 180 ? 7.0 : 3.0; };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  EXPECT_EQ(source->Read({2, 1, 3})->At(4, source->LatticeOf(2).cells), 5);
  EXPECT_EQ(source->Read({2, 6, 0})->At(4, 0), 7);
  const std::vector<GeoPosition> poles{{0, 90}, {91, 90}, {-179.5, 90}, {33, -90}};
  EXPECT_EQ(*source->ReadPoints(poles), (std::vector<float>{5, 5, 5, 7}));
}

TEST(Resampling, SmallVoidsAreBridgedAndLargeOnesFallToTheFloorOnDemand) {
  const TempDir dir;
  RasterSpec spec = PlaneSpec(10, 20, .01, 400, 400);
  const auto plane = spec.value;
  spec.nodata = -500;
  spec.value = [=](int col, int row) {
    const bool small = std::abs(col - 100) < 10 && std::abs(row - 100) < 10;
    const bool large = std::abs(col - 280) < 60 && std::abs(row - 280) < 60;
    return small || large ? -500 : plane(col, row);
  };
  const auto source = OpenOrFail(WriteRaster(dir, spec), {.floor = -9, .holes = HoleFill::kFloor});
  const auto at = [&](double longitude, double latitude) {
    const int level = source->max_level();
    const double size = 180.0 / static_cast<double>(geo::TileRows(level));
    const geo::TileKey key{level, static_cast<std::int64_t>((longitude + 180) / size),
                           static_cast<std::int64_t>((latitude + 90) / size)};
    const auto tile = source->Read(key);
    const double step = tile->lattice.StepDegrees();
    const int i =
        static_cast<int>(std::lround((longitude - tile->lattice.Longitude(tile->lattice.FirstColumn(key))) / step));
    const int j =
        static_cast<int>(std::lround((latitude - tile->lattice.Latitude(tile->lattice.FirstRow(key))) / step));
    return tile->At(i, j);
  };
  EXPECT_NEAR(at(11, 19), 100 * 11 - 30 * 19, .5);
  EXPECT_EQ(at(12.8, 17.2), -9);
}

// Rasters as gdalwarp -dstalpha and -co PIXELTYPE=SIGNEDBYTE write them.
TEST(Resampling, AlphaOfAnyTypeAndSignedBytesAreUnderstood) {
  GDALAllRegister();
  const auto write = [](const std::string& path, GDALDataType type, int bands, const char* pixel_type) {
    const char* const options[] = {"ALPHA=YES", pixel_type, nullptr};
    GDALDatasetUniquePtr dataset(GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
        path.c_str(), 16, 16, bands, type, const_cast<char**>(bands > 1 ? options : options + 1)));
    double transform[] = {8, 1, 0, 47, 0, -1};
    dataset->SetGeoTransform(transform);
    OGRSpatialReference srs;
    srs.SetWellKnownGeogCS("WGS84");
    dataset->SetSpatialRef(&srs);
    for (int band = 1; band <= bands; ++band) {
      for (int row = 0; row < 16; ++row) {
        std::vector<double> line(16, band == 1 ? (pixel_type ? 231 : 25) : 255);
        std::fill_n(line.begin(), bands > 1 ? 4 : 0, 0);
        ASSERT_EQ(dataset->GetRasterBand(band)->RasterIO(GF_Write, 0, row, 16, 1, line.data(), 16, 1, GDT_Float64, 0, 0,
                                                         nullptr),
                  CE_None);
      }
    }
    if (bands > 1) dataset->GetRasterBand(bands)->SetColorInterpretation(GCI_AlphaBand);
  };
  const TempDir dir;
  int index = 0;
  for (const GDALDataType type : {GDT_Byte, GDT_Int16, GDT_Float32}) {
    SCOPED_TRACE(index);
    const std::string path = dir.File(std::to_string(index++) + ".tif");
    write(path, type, 2, nullptr);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->info().sources[0].void_samples, 64u);
    EXPECT_EQ(source->info().heights.min, 25);
  }
  write(dir.File("signed.tif"), GDT_Byte, 1, "PIXELTYPE=SIGNEDBYTE");
  const auto source = OpenOrFail(dir.File("signed.tif"));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->info().heights.min, -25);
}

TEST(Resampling, UndeclaredVoidsAndUnitsAreUnderstood) {
  const TempDir dir;
  struct Case {
    std::string type, unit;
    std::optional<double> nodata;
    double mark, value, height;
  };
  const std::vector<Case> cases = {{"Int16", "", std::nullopt, -32768, 10, 10},
                                   {"Float32", "", 1.70141e38, 1.70141e38, 10, 10},
                                   {"Float32", "", std::nullopt, 3.4e38, 10, 10},
                                   {"Float64", "ft", std::nan(""), std::nan(""), 100, 30.48},
                                   {"Float32", "", -3.4028234663852886e38, -3.4028234663852886e38, 10, 10},
                                   {"Int32", "US survey foot", -99999, -99999, 3937, 1200},
                                   {"Int32", "Foot_US", -99999, -99999, 3937, 1200},
                                   {"Int32", "Feet (US)", -99999, -99999, 3937, 1200},
                                   {"Int32", "fathom", -99999, -99999, 1000, 1828.8},
                                   {"Int32", "Fathoms", -99999, -99999, 1000, 1828.8},
                                   {"Byte", "m", 255, 255, 7, 7}};
  int index = 0;
  for (const Case& c : cases) {
    SCOPED_TRACE(index);
    RasterSpec spec{.type = c.type, .nodata = c.nodata, .unit = c.unit};
    spec.value = [&](int col, int) { return col < 4 ? c.mark : c.value; };
    const auto source = OpenOrFail(WriteRaster(dir, spec, std::to_string(index++) + ".tif"));
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->info().sources[0].void_samples, 64u);
    EXPECT_NEAR(source->info().heights.min, c.height, 1e-4);
    EXPECT_NEAR(source->info().heights.max, c.height, 1e-4);
    EXPECT_EQ(source->info().sources[0].height_unit, c.unit);
  }
}

}  // namespace
}  // namespace terrace::dem

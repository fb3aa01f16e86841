#include <fmt/format.h>
#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>

#include <cmath>
#include <fstream>

#include "engine/image/raster_colors.h"
#include "engine/sources/read_raster.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

struct ColorSpec {
  int width = 16, height = 16, bands = 3;
  GDALDataType type = GDT_Byte;
  std::array<double, 6> geo_transform = {0, 1, 0, 0, 0, -1};
  bool georeferenced = true;
  std::string crs = "EPSG:4326";
  std::optional<double> nodata = {};
  bool has_alpha = false;  // the last band
  bool has_palette = false;
  const char* bits = nullptr;  // "12": so many of a sample are used
  bool states_rgb = false;     // the first three bands are red, green and blue also if there are more than four
  // Raw value of column, row and band, counted from 0.
  std::function<int(int, int, int)> value = [](int, int, int) { return 0; };
};

const std::array<GDALColorEntry, 3> kPalette = {{{10, 20, 30, 255}, {200, 100, 50, 255}, {1, 2, 3, 255}}};

std::string WriteColors(const TempDir& dir, ColorSpec spec, const std::string& name = "image.tif") {
  GDALAllRegister();
  const std::string path = dir.File(name);
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  CPLStringList options;
  if (spec.bits != nullptr) options.SetNameValue("NBITS", spec.bits);
  if (spec.states_rgb) options.SetNameValue("PHOTOMETRIC", "RGB");
  GDALDatasetUniquePtr dataset(
      driver->Create(path.c_str(), spec.width, spec.height, spec.bands, spec.type, options.List()));
  if (spec.georeferenced) dataset->SetGeoTransform(spec.geo_transform.data());
  if (!spec.crs.empty()) {
    OGRSpatialReference srs;
    EXPECT_EQ(srs.SetFromUserInput(spec.crs.c_str()), OGRERR_NONE);
    dataset->SetSpatialRef(&srs);
  }
  if (spec.has_palette) {
    GDALColorTable table;
    for (std::size_t i = 0; i < kPalette.size(); ++i) table.SetColorEntry(static_cast<int>(i), &kPalette[i]);
    dataset->GetRasterBand(1)->SetColorTable(&table);
  }
  if (spec.has_alpha) dataset->GetRasterBand(spec.bands)->SetColorInterpretation(GCI_AlphaBand);
  for (int i = 0; i < spec.bands; ++i) {
    GDALRasterBand& band = *dataset->GetRasterBand(i + 1);
    if (spec.nodata) band.SetNoDataValue(*spec.nodata);
    std::vector<int> values;
    for (int row = 0; row < spec.height; ++row) {
      for (int col = 0; col < spec.width; ++col) values.push_back(spec.value(col, row, i));
    }
    EXPECT_EQ(band.RasterIO(GF_Write, 0, 0, spec.width, spec.height, values.data(), spec.width, spec.height, GDT_Int32,
                            0, 0, nullptr),
              CE_None);
  }
  return path;
}

Result<std::vector<Rgba>> Colors(const std::string& image, const std::string& dem) {
  const auto raster = ReadRaster(dem);
  EXPECT_TRUE(raster.has_value());
  return ReadColors(image, dem, *raster);
}

void ExpectRefused(const std::string& image, const std::string& dem, const std::vector<std::string>& words) {
  const auto colors = Colors(image, dem);
  ASSERT_FALSE(colors.has_value());
  EXPECT_EQ(colors.error().code, ErrorCode::kInvalidArgument);
  for (const std::string& word : words) {
    EXPECT_NE(colors.error().message.find(word), std::string::npos) << word << " in " << colors.error().message;
  }
}

// Red is the longitude, green the latitude, both in tenths of a degree from the corner at 6 E, 46 N. They are linear,
// so bilinear interpolation is exact.
ColorSpec Gradient() {
  return {
      .width = 200, .height = 100, .geo_transform = {6, .1, 0, 56, 0, -.1}, .value = [](int col, int row, int band) {
        return band == 0 ? col : band == 1 ? 99 - row : 77;
      }};
}

TEST(ReadColors, TakesPixelBySampleWithoutAGeoreference) {
  const TempDir dir;
  const auto value = [](int col, int row, int band) { return 10 * col + row + 60 * band; };
  const std::string image =
      WriteColors(dir, {.width = 7, .height = 5, .georeferenced = false, .crs = "", .value = value});
  const std::string dem = WriteRaster(dir, {.width = 7, .height = 5});
  const auto colors = Colors(image, dem);
  ASSERT_TRUE(colors) << colors.error().message;
  for (int i = 0; i < 35; ++i) {
    const auto level = [&](int band) { return static_cast<std::uint8_t>(value(i % 7, i / 7, band)); };
    EXPECT_EQ((*colors)[static_cast<std::size_t>(i)], (Rgba{level(0), level(1), level(2), 255}));
  }
}

TEST(ReadColors, PlacesByDegrees) {
  const TempDir dir;
  const std::string image = WriteColors(dir, Gradient());
  for (const double turn : {0.0, 360.0}) {  // also a DEM whose longitudes are 360 degrees larger
    const std::string dem =
        WriteRaster(dir, {.width = 30, .height = 20, .geo_transform = {8 + turn, .05, 0, 50, 0, -.05}});
    const auto colors = Colors(image, dem);
    ASSERT_TRUE(colors) << colors.error().message;
    for (int i = 0; i < 600; ++i) {
      const Rgba& color = (*colors)[static_cast<std::size_t>(i)];
      EXPECT_NEAR(color[0], (8 + .05 * (i % 30 + .5) - 6) * 10 - .5, .501);
      EXPECT_NEAR(color[1], (50 - .05 * (i / 30 + .5) - 46) * 10 - .5, .501);
      EXPECT_EQ(color[2], 77);
    }
  }
}

TEST(ReadColors, PlacesThroughProjWhereReferenceSystemsDiffer) {
  const TempDir dir;
  const std::string image = WriteColors(dir, Gradient());
  const std::string dem = WriteRaster(
      dir, {.width = 40, .height = 30, .geo_transform = {400000, 5000, 0, 5500000, 0, -5000}, .crs = "EPSG:32632"});
  const auto colors = Colors(image, dem);
  ASSERT_TRUE(colors) << colors.error().message;
  OGRSpatialReference utm, degrees;
  utm.importFromEPSG(32632);
  degrees.importFromEPSG(4326);
  degrees.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  const std::unique_ptr<OGRCoordinateTransformation> transformation(OGRCreateCoordinateTransformation(&utm, &degrees));
  for (int i = 0; i < 1200; ++i) {
    double x = 400000 + 5000 * (i % 40 + .5), y = 5500000 - 5000 * (i / 40 + .5);
    ASSERT_TRUE(transformation->Transform(1, &x, &y));
    EXPECT_NEAR((*colors)[static_cast<std::size_t>(i)][0], (x - 6) * 10 - .5, .501);
    EXPECT_NEAR((*colors)[static_cast<std::size_t>(i)][1], (y - 46) * 10 - .5, .501);
  }
}

TEST(ReadColors, AveragesPixelsThatAreFinerThanSamples) {
  const TempDir dir;
  // A checkerboard under samples that are 8 pixels apart: without averaging, colours would be black or white.
  const std::string image = WriteColors(dir, {.width = 128,
                                              .height = 128,
                                              .geo_transform = {500000, 1, 0, 5000000, 0, -1},
                                              .crs = "EPSG:32632",
                                              .value = [](int col, int row, int) { return (col + row) % 2 * 255; }});
  const std::string dem = WriteRaster(
      dir, {.width = 16, .height = 16, .geo_transform = {500000, 8, 0, 5000000, 0, -8}, .crs = "EPSG:32632"});
  const auto colors = Colors(image, dem);
  ASSERT_TRUE(colors) << colors.error().message;
  for (const Rgba& color : *colors) EXPECT_EQ(color, (Rgba{128, 128, 128, 255}));
}

TEST(ReadColors, DoesNotMixInWhatIsTransparent) {
  const TempDir dir;
  const std::string dem = WriteRaster(dir, {.width = 30, .height = 30, .geo_transform = {.1, .5, 0, -.1, 0, -.5}});
  const std::string image = WriteColors(dir, {.bands = 4, .has_alpha = true, .value = [](int col, int, int band) {
                                                if (band == 3) return col < 8 ? 0 : 255;
                                                return col < 8 ? 255 : 40;
                                              }});
  const auto colors = Colors(image, dem);
  ASSERT_TRUE(colors) << colors.error().message;
  for (int i = 0; i < 900; ++i) {
    const bool is_clear = .1 + .5 * (i % 30 + .5) <= 7.5;  // the centre of the last transparent pixel
    const Rgba expected = is_clear ? Rgba{} : Rgba{40, 40, 40, 255};
    EXPECT_EQ((*colors)[static_cast<std::size_t>(i)], expected) << i;
  }
}

TEST(ReadColors, RefusesAnImageThatDoesNotFit) {
  const TempDir dir;
  const std::string dem = WriteRaster(dir, {.width = 30, .height = 20, .geo_transform = {8, .05, 0, 50, 0, -.05}});
  const std::string plain =
      WriteColors(dir, {.width = 31, .height = 20, .georeferenced = false, .crs = ""}, "plain.tif");
  ColorSpec inks{.bands = 4};
  const std::string printed = WriteColors(dir, inks, "printed.tif");
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(printed.c_str(), GDAL_OF_RASTER));  // stated beside the file
    for (int i = 0; i < 4; ++i) {
      dataset->GetRasterBand(i + 1)->SetColorInterpretation(static_cast<GDALColorInterp>(GCI_CyanBand + i));
    }
  }
  ExpectRefused(printed, dem, {"printed.tif: band 1 holds Cyan", "RGB"});
  ExpectRefused(plain, dem, {"plain.tif has 31 x 20", "30 x 20", "no georeference", "-outsize 30 20", "-a_ullr"});
  ColorSpec beside = Gradient();
  beside.geo_transform[0] = 8.2;
  ExpectRefused(WriteColors(dir, beside, "beside.tif"), dem,
                {"beside.tif does not cover", "column 0, row 0", "gdalwarp"});
  ColorSpec placeless = Gradient();
  placeless.crs = "";
  ExpectRefused(WriteColors(dir, placeless, "placeless.tif"), dem, {"placeless.tif", "-a_srs"});
}

TEST(ReadColors, NeedsNoImageUnderVoids) {
  const TempDir dir;
  ColorSpec beside = Gradient();
  beside.geo_transform[0] = 8.2;
  const std::string dem = WriteRaster(
      dir,
      {.width = 30, .height = 20, .geo_transform = {8, .05, 0, 50, 0, -.05}, .nodata = -1, .value = [](int col, int) {
         return col < 6 ? -1 : 5;
       }});
  const auto colors = Colors(WriteColors(dir, beside), dem);
  ASSERT_TRUE(colors) << colors.error().message;
  EXPECT_EQ((*colors)[0], Rgba{});
  EXPECT_EQ((*colors)[29][3], 255);
}

TEST(ReadImage, KnowsEveryKindOfBands) {
  const TempDir dir;
  const auto pixel = [&](const ColorSpec& spec, int col, int row) {
    const auto image = ReadImage(WriteColors(dir, spec));
    EXPECT_TRUE(image) << image.error().message;
    return image ? image->colors[static_cast<std::size_t>(row * image->width + col)] : Rgba{};
  };
  const auto value = [](int col, int row, int band) { return 100 * band + 10 * row + col; };
  EXPECT_EQ(pixel({.bands = 1, .value = value}, 3, 4), (Rgba{43, 43, 43, 255}));
  EXPECT_EQ(pixel({.bands = 3, .value = value}, 3, 4), (Rgba{43, 143, 243, 255}));
  EXPECT_EQ(pixel({.bands = 2, .has_alpha = true, .value = [](int col, int, int) { return col; }}, 0, 0),
            (Rgba{0, 0, 0, 0}));
  EXPECT_EQ(pixel({.bands = 2, .has_alpha = true, .value = [](int col, int, int) { return col; }}, 9, 0),
            (Rgba{9, 9, 9, 255}));
  const auto index = [](int col, int, int) { return col % 4; };
  EXPECT_EQ(pixel({.bands = 1, .has_palette = true, .value = index}, 1, 0), (Rgba{200, 100, 50, 255}));
  EXPECT_EQ(pixel({.bands = 1, .nodata = 2, .has_palette = true, .value = index}, 1, 0), (Rgba{200, 100, 50, 255}));
  EXPECT_EQ(pixel({.bands = 1, .nodata = 2, .has_palette = true, .value = index}, 2, 0)[3], 0);
  EXPECT_EQ(pixel({.bands = 3, .type = GDT_UInt16, .value = [](int, int, int band) { return band * 32767; }}, 0, 0),
            (Rgba{0, 127, 255, 255}));
  const ColorSpec wide{
      .type = GDT_UInt16, .bits = "12", .value = [](int, int, int band) { return (4096 * band - band) / 2; }};
  EXPECT_EQ(pixel(wide, 0, 0), (Rgba{0, 127, 255, 255}));
  // A nodata value in one band is a dark colour; in all bands it is no colour.
  EXPECT_EQ(pixel({.nodata = 0, .value = [](int, int, int band) { return band; }}, 0, 0), (Rgba{0, 1, 2, 255}));
  EXPECT_EQ(pixel({.nodata = 0}, 0, 0)[3], 0);
}

// GDAL's mask of a band is that of the nodata value where there is one, and ignores the alpha band of more than four.
TEST(ReadImage, HidesWhatAlphaHidesAndWhatIsNodata) {
  for (const int bands : {2, 4, 5}) {
    for (const std::optional<double> nodata : {std::optional<double>(), std::optional(0.0)}) {
      for (const GDALDataType type : {GDT_Byte, GDT_UInt16}) {
        SCOPED_TRACE(fmt::format("{} bands of {}, {}", bands, GDALGetDataTypeName(type), nodata ? "nodata" : ""));
        const TempDir dir;
        // The left half is transparent, the upper half has the value of nodata, 0. Alpha 1 is not transparent.
        const int light = type == GDT_Byte ? 200 : 200 * 257;
        const auto value = [&](int col, int row, int band) {
          if (band == bands - 1) return col < 8 ? 0 : 1;
          return row < 8 ? 0 : light;
        };
        const auto image = ReadImage(WriteColors(dir, {.bands = bands,
                                                       .type = type,
                                                       .nodata = nodata,
                                                       .has_alpha = true,
                                                       .states_rgb = bands == 5,
                                                       .value = value}));
        ASSERT_TRUE(image) << image.error().message;
        for (int i = 0; i < 256; ++i) {
          const Rgba& color = image->colors[static_cast<std::size_t>(i)];
          const bool is_nodata = nodata && i / 16 < 8;
          ASSERT_EQ(color[3], i % 16 < 8 || is_nodata ? 0 : 255) << i;
          const int level = color[3] == 0 || i / 16 < 8 ? 0 : 200;
          ASSERT_EQ(color[3] == 0 ? 0 : color[0], level) << i;
        }
      }
    }
  }
}

// GDAL's mask of a band is then that of the dataset.
TEST(ReadImage, HidesWhatAlphaHidesAndWhatAMaskHides) {
  const TempDir dir;
  const std::string path = WriteColors(dir, {.bands = 4, .has_alpha = true, .value = [](int col, int, int band) {
                                               return band == 3 ? col % 2 * 255 : 200;
                                             }});
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    ASSERT_EQ(dataset->CreateMaskBand(GMF_PER_DATASET), CE_None);
    std::vector<std::uint8_t> shown(128, 255);  // the lower half
    ASSERT_EQ(dataset->GetRasterBand(1)->GetMaskBand()->RasterIO(GF_Write, 0, 8, 16, 8, shown.data(), 16, 8, GDT_Byte,
                                                                 0, 0, nullptr),
              CE_None);
  }
  const auto image = ReadImage(path);
  ASSERT_TRUE(image) << image.error().message;
  for (int i = 0; i < 256; ++i) {
    EXPECT_EQ(image->colors[static_cast<std::size_t>(i)][3], i / 16 >= 8 && i % 2 == 1 ? 255 : 0) << i;
  }
}

TEST(ReadImage, RefusesWhatIsNoImage) {
  const TempDir dir;
  const auto refuses = [](const std::string& path, const char* words) {
    const auto image = ReadImage(path);
    ASSERT_FALSE(image.has_value());
    EXPECT_NE(image.error().message.find(words), std::string::npos) << image.error().message;
    EXPECT_NE(image.error().message.find(path), std::string::npos) << image.error().message;
  };
  refuses(WriteColors(dir, {.bands = 1, .type = GDT_Float32}, "heights.tif"), "gdal_translate -ot Byte -scale");
  refuses(WriteColors(dir, {.bands = 2}, "two.tif"), "gdal_translate -b 1 -b 2 -b 3");
  refuses(dir.File("missing.tif"), "No such file");
  const std::string text = dir.File("text.tif");
  std::ofstream(text) << "no image";
  refuses(text, "cannot be opened as a raster");
}

TEST(ReadColors, CoversTheGlobeWithAPaletteOfAnotherResolution) {
  TERRACE_REQUIRE_DATA(dem, "etopo5_global_10min.tif");
  TERRACE_REQUIRE_DATA(image, "bluemarble_1920x960.tif");
  const auto colors = Colors(image, dem);
  ASSERT_TRUE(colors) << colors.error().message;
  const auto at = [&](double longitude, double latitude) {
    return (*colors)[static_cast<std::size_t>(std::lround((90 - latitude) * 6) * 2160 +
                                              std::lround((longitude + 180) * 6))];
  };
  for (const Rgba& color : *colors) ASSERT_EQ(color[3], 255);
  const Rgba sahara = at(10, 23), ocean = at(-150, 0), greenland = at(-40, 73);
  EXPECT_GT(sahara[0], sahara[2] + 50);
  EXPECT_GT(ocean[2], ocean[0]);
  EXPECT_GT(std::min({greenland[0], greenland[1], greenland[2]}), 200);
}

}  // namespace
}  // namespace terrace::dem

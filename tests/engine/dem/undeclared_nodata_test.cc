// Voids that files do not declare. Each case has a counterpart: real terrain that looks similar and must stay.
#include "engine/statistics/undeclared_nodata.h"

#include <cpl_conv.h>
#include <gdal_priv.h>
#include <gdal_utils.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

double Land(int col, int row) { return 1200 + 200 * std::sin(col / 17.0) * std::cos(row / 13.0); }

RasterSpec Synthetic(std::function<double(int, int)> value) {
  return {
      .width = 200, .height = 200, .geo_transform = {8, .01, 0, 47, 0, -.01}, .nodata = -1, .value = std::move(value)};
}

const RasterInfo& InfoOf(const ElevationModel& model) { return model.info().sources.front(); }

// All heights of all tiles that touch the source are within the range.
void ExpectHeightsWithin(const ElevationModel& model, double lowest, double highest) {
  for (int level = 0; level <= model.max_level(); ++level) {
    for (const geo::TileKey& key : SomeTiles(model, level, 12)) {
      const auto tile = model.Read(key);
      ASSERT_TRUE(tile) << tile.error().message;
      for (const float height : tile->heights) {
        ASSERT_GE(height, lowest) << geo::ToString(key);
        ASSERT_LE(height, highest) << geo::ToString(key);
      }
    }
  }
}

TEST(UndeclaredNodata, UndeclaredSpikesAreVoids) {
  for (const double nodata : {-32768.0, -32767.0, -9999.0, 32767.0, 9999.0, 65535.0}) {
    const TempDir dir;
    const auto source = OpenOrFail(WriteRaster(
        dir, Synthetic([nodata](int col, int row) { return col == 100 && row % 60 == 30 ? nodata : Land(col, row); })));
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(InfoOf(*source).void_samples, 3u) << nodata;
    EXPECT_NE(InfoOf(*source).found_voids.find("3 samples of"), std::string::npos) << InfoOf(*source).found_voids;
    EXPECT_GE(InfoOf(*source).heights.min, 1000) << nodata;
    EXPECT_LE(InfoOf(*source).heights.max, 1400) << nodata;
    ExpectHeightsWithin(*source, 1000, 1400);
  }
}

TEST(UndeclaredNodata, TwoValuesCloseTogetherAreBothVoids) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Synthetic([](int col, int row) {
                                               return col == 100 && row % 60 == 30  ? -32768
                                                      : col == 50 && row % 40 == 20 ? -32767
                                                                                    : Land(col, row);
                                             })));
  EXPECT_TRUE(source && InfoOf(*source).void_samples == 3 + 5);
}

TEST(UndeclaredNodata, CanBeSwitchedOffAndStated) {
  const TempDir dir;
  const std::string path =
      WriteRaster(dir, Synthetic([](int col, int row) { return col == 100 && row == 30 ? -9999 : Land(col, row); }));
  const auto trusted = OpenOrFail(path, {.source = {.vertical = "unknown", .find_voids = false}});
  const auto stated = OpenOrFail(path, {.source = {.vertical = "unknown", .find_voids = false, .nodata = {-9999, 5}}});
  ASSERT_TRUE(trusted && stated);
  EXPECT_EQ(InfoOf(*trusted).void_samples, 0u);
  EXPECT_EQ(InfoOf(*trusted).heights.min, -9999);
  EXPECT_EQ(InfoOf(*stated).void_samples, 1u);
  EXPECT_EQ(InfoOf(*stated).found_voids, "");
}

TEST(UndeclaredNodata, ATrenchIsNoVoid) {
  // A sea floor that passes through -9,999 m and has declared voids.
  const TempDir dir;
  auto spec = Synthetic([](int col, int row) {
    if (col > 150 && row > 150) return -1.0;
    return std::round(-5000 - 5500 * std::exp(-(col - 100.0) * (col - 100.0) / 400)) - row % 3;
  });
  spec.value = [value = spec.value](int col, int row) { return col == 100 && row == 10 ? -9999 : value(col, row); };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "");
  EXPECT_EQ(InfoOf(*source).void_samples, 49u * 49u);
  EXPECT_LE(InfoOf(*source).heights.min, -10'500);
}

TEST(UndeclaredNodata, HighAndDeepRealTerrainStays) {
  TERRACE_REQUIRE_DATA(earth, "etopo5_global_10min.tif");
  TERRACE_REQUIRE_DATA(antarctica, "pole_antarctica_bedmap_5km.tif");
  TERRACE_REQUIRE_DATA(hawaii, "antimeridian_hawaii_topobathy_5min.tif");
  for (const std::string& path : {earth, antarctica, hawaii}) {
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(InfoOf(*source).found_voids, "") << path;
  }
}

TEST(UndeclaredNodata, NoRealRasterIsAccused) {
  int seen = 0;
  for (const std::string& name : RealRasters()) {
    const auto path = TestDataFile(name);
    if (!path) continue;
    const auto source = OpenOrFail(*path);
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(InfoOf(*source).found_voids, "") << name;
    ++seen;
  }
  if (seen == 0) GTEST_SKIP() << "SKIPPED, test data missing; set TERRACE_TEST_DATA";
}

// Resampling with a kernel leaves values between the nodata value and the ground at the edge of a void.
double Mixed(int col, int row) {
  const double distance = std::hypot(col - 100, row - 100) - 30;
  if (distance <= 0) return -1;
  const double share = std::max(0.0, 1 - distance / 2);
  return share * -32768 + (1 - share) * Land(col, row);
}

TEST(UndeclaredNodata, EdgesMixedWithNodataAreVoids) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Synthetic(Mixed)));
  ASSERT_NE(source, nullptr);
  EXPECT_NE(InfoOf(*source).found_voids, "");
  EXPECT_GE(InfoOf(*source).heights.min, 999) << InfoOf(*source).found_voids;
  ExpectHeightsWithin(*source, 999, 1401);
}

TEST(UndeclaredNodata, AWindowShowsTheSameVoidsAsTheWhole) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Synthetic(Mixed));
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  SampleRules rules = SampleRules::Of(band, "");
  rules.lowest = -500;
  rules.void_margin = 2;
  std::vector<float> whole(200 * 200), part(37 * 23);
  ASSERT_TRUE(ReadHeights(band, rules, 0, 0, 200, 200, whole.data(), {}));
  for (const auto& [col, row] : {std::pair(60, 80), std::pair(0, 0), std::pair(120, 110), std::pair(163, 177)}) {
    ASSERT_TRUE(ReadHeights(band, rules, col, row, 37, 23, part.data(), {}));
    for (int i = 0; i < 37 * 23; ++i) {
      const float expected = whole[static_cast<std::size_t>((row + i / 37) * 200 + col + i % 37)];
      ASSERT_TRUE(part[i] == expected || (std::isnan(part[i]) && std::isnan(expected))) << col << ' ' << i;
    }
  }
}

// A rotated square of data in a frame of zeros, as reprojection without a nodata value leaves it.
double Framed(int col, int row) { return std::abs(col - 100) + std::abs(row - 100) > 90 ? 0 : Land(col, row); }

TEST(UndeclaredNodata, ACollarOfZerosIsVoid) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Synthetic(Framed)));
  ASSERT_NE(source, nullptr);
  EXPECT_NE(InfoOf(*source).found_voids.find("collar"), std::string::npos) << InfoOf(*source).found_voids;
  EXPECT_GE(InfoOf(*source).heights.min, 999);
  ExpectHeightsWithin(*source, 999, 1401);
}

TEST(UndeclaredNodata, ACollarOfIntegersWithAnOffsetIsVoid) {
  const TempDir dir;
  RasterSpec spec = Synthetic([](int col, int row) { return std::round((Framed(col, row) - 613.9) / 0.1); });
  spec.type = "Int16", spec.scale = 0.1, spec.offset = 613.9;  // -613.9 / 0.1 is not exactly -6139
  spec.nodata = std::nullopt;
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(source, nullptr);
  EXPECT_GE(InfoOf(*source).heights.min, 999) << InfoOf(*source).found_voids;
}

TEST(UndeclaredNodata, ASeaIsNoCollar) {
  // Cliffs of 300 m along half of the coast, beaches along the rest; an island in a sea at exactly 0 m.
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Synthetic([](int col, int row) {
                                               const double inland = 80 - std::hypot(col - 100, row - 100);
                                               if (inland <= 0) return 0.0;
                                               return std::round(col < 100 ? 300 + inland : 1 + inland * 5);
                                             })));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "");
  EXPECT_EQ(InfoOf(*source).void_samples, 0u);
}

// Samples are ten minutes apart, so at every coast of a steep country the next sample is hundreds of metres higher.
TEST(UndeclaredNodata, ASeaOfACoarseRasterIsNoCollar) {
  const TempDir dir;
  RasterSpec spec = Synthetic([](int col, int row) {
    const double inland = 95 - std::abs(col - 100) - 0.5 * std::abs(row - 100) + 20 * std::sin(col + row / 3.0);
    return inland <= 0 && row > 3 ? 0 : std::round(250 + 20 * std::abs(inland));
  });
  spec.geo_transform = {-80, 1.0 / 6, 0, 10, 0, -1.0 / 6};
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "");
  EXPECT_EQ(InfoOf(*source).void_samples, 0u);
}

TEST(UndeclaredNodata, FlatGroundAtZeroBelowACliffStays) {
  const std::vector<std::function<double(int, int)>> grounds = {
      [](int col, int) { return col < 100 ? 0.0 : 9000.0; },                                           // one step
      [](int col, int row) { return col > 80 && col < 120 && row > 90 && row < 99 ? 500.0 : 0.0; },    // a block
      [](int col, int row) { return col % 25 == 12 && row % 25 == 12 ? 500.0 : 0.0; },                 // spikes
      [](int col, int row) { return (col / 20 + row / 20) % 2 == 0 ? 1000.0 : 0.0; },                  // a checkerboard
      [](int col, int row) { return col < 60 ? 0.0 : Land(col, row); },                                // an escarpment
      [](int col, int row) { return std::hypot(col - 100, row - 100) < 70 ? Land(col, row) : 0.0; }};  // an island
  for (std::size_t i = 0; i < grounds.size(); ++i) {
    SCOPED_TRACE(i);
    const TempDir dir;
    const auto source = OpenOrFail(WriteRaster(dir, Synthetic(grounds[i])));
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(InfoOf(*source).found_voids, "");
    EXPECT_EQ(InfoOf(*source).void_samples, 0u);
    EXPECT_EQ(InfoOf(*source).heights.min, 0);
  }
}

TEST(UndeclaredNodata, NarrowBathymetryStays) {
  // Tracks of a ship: every depth is beside a void.
  const TempDir dir;
  const auto source =
      OpenOrFail(WriteRaster(dir, Synthetic([](int col, int row) { return row % 40 < 5 ? -4000.0 + col : -1.0; })));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "");
  EXPECT_EQ(InfoOf(*source).valid_samples, 5u * 5u * 200u);
  EXPECT_EQ(InfoOf(*source).heights.min, -4000);
}

// Opens a raster with these values and -99999 as declared nodata, and expects that all other samples are served.
void ExpectEverySampleStays(const std::function<double(int, int)>& value) {
  const TempDir dir;
  RasterSpec spec = Synthetic(value);
  spec.nodata = -99999;
  std::uint64_t measured = 0;
  double lowest = 1e9, highest = -1e9;
  for (int i = 0; i < spec.width * spec.height; ++i) {
    const double height = value(i % spec.width, i / spec.width);
    if (height == -99999) continue;
    ++measured;
    lowest = std::min(lowest, height);
    highest = std::max(highest, height);
  }
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "");
  EXPECT_EQ(InfoOf(*source).valid_samples, measured);
  EXPECT_FLOAT_EQ(static_cast<float>(InfoOf(*source).heights.min), static_cast<float>(lowest));
  EXPECT_FLOAT_EQ(static_cast<float>(InfoOf(*source).heights.max), static_cast<float>(highest));
}

// Land 200 m high, then a coast and a slope to -1,400 m.
double Shelf(int col, int row) {
  return (col < 110 ? 200 : -100 - 6.5 * col) + 20 * std::sin(col / 7.0) * std::cos(row / 5.0);
}

TEST(UndeclaredNodata, TracksOfAShipStay) {
  std::mt19937 random(1);
  for (int round = 0; round < 12; ++round) {
    const int width = 1 + static_cast<int>(random() % 6), period = width + 2 + static_cast<int>(random() % 30);
    const int phase = static_cast<int>(random() % 30),
              measured = round % 2 == 0 ? 0 : 80 + static_cast<int>(random() % 60);
    SCOPED_TRACE(testing::Message() << width << " of " << period << " rows, all of them west of " << measured);
    ExpectEverySampleStays([&](int col, int row) {
      return col < measured || (row + phase) % period < width ? Shelf(col, row) : -99999.0;
    });
  }
}

TEST(UndeclaredNodata, TerrainBetweenScatteredVoidsStays) {
  std::mt19937 random(2);
  for (const double share : {.003, .02, .1, .4, .8}) {
    for (const double relief : {400.0, 2000.0}) {  // the second has steps everywhere
      SCOPED_TRACE(testing::Message() << share << ' ' << relief);
      std::vector<double> drawn(200 * 200);
      std::uniform_real_distribution<double> chance(0, 1);
      for (std::size_t i = 0; i < drawn.size(); ++i) {
        drawn[i] = chance(random) < share ? -99999 : -300 + relief * (chance(random) + chance(random) - 1);
      }
      ExpectEverySampleStays(
          [&](int col, int row) { return drawn[static_cast<std::size_t>(row) * 200 + static_cast<std::size_t>(col)]; });
    }
  }
}

// The data ends just below -500 m, so all deeper samples are beside the void.
TEST(UndeclaredNodata, ASeaFloorThatEndsBelowTheLowestLandStays) {
  for (const double slope : {1.0, 20.0, 300.0}) {  // metres from a column to the next, 750 m on
    for (const int deep : {1, 2, 3}) {
      SCOPED_TRACE(testing::Message() << slope << ' ' << deep);
      ExpectEverySampleStays([&](int col, int row) {
        if (col >= 100) return -99999.0;
        return -500 - slope * (col - 99.5 + deep) + 0.2 * std::sin(row / 9.0);
      });
    }
  }
}

// Wrong samples beside three of many voids become voids, but samples beside the other voids do not.
TEST(UndeclaredNodata, VoidsWithoutMixturesDoNotGrow) {
  const TempDir dir;
  const auto is_void = [](int col, int row) { return col % 25 == 12 && row % 25 == 12; };
  const auto source =
      OpenOrFail(WriteRaster(dir, Synthetic([&](int col, int row) {
                               if (is_void(col, row)) return -1.0;
                               return is_void(col - 1, row) && row == 37 && col < 80 ? -5000 : Land(col, row);
                             })));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "3 samples below -500 m at their edges");
  EXPECT_EQ(InfoOf(*source).void_samples, 64U + 3U);
}

TEST(UndeclaredNodata, ACollarDoesNotGrowScatteredVoids) {
  const TempDir dir;
  const auto is_void = [](int col, int row) { return col % 6 == 3 && row % 6 == 3 && Framed(col, row) != 0; };
  std::uint64_t voids = 0;
  for (int i = 0; i < 200 * 200; ++i) voids += is_void(i % 200, i / 200) || Framed(i % 200, i / 200) == 0;
  const auto source = OpenOrFail(
      WriteRaster(dir, Synthetic([&](int col, int row) { return is_void(col, row) ? -1.0 : Framed(col, row); })));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).found_voids, "a collar of zeros");
  EXPECT_EQ(InfoOf(*source).void_samples, voids);
}

// GDAL shifts a raster by fractions of a pixel, and treats the nodata value as a height.
TEST(UndeclaredNodata, EdgesThatResamplingMixedAreFound) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> part(0.05, 0.95);
  for (const double nodata : {-32768.0, -9999.0}) {
    for (const char* kernel : {"bilinear", "cubic"}) {
      const TempDir dir;
      RasterSpec spec = Synthetic([&](int col, int row) {
        const bool is_block = col > 30 && col < 60 && row > 90 && row < 150;
        const bool is_gap = col % 50 > 40 && row % 40 > 33;
        return is_block || is_gap || std::hypot(col - 130, row - 120) < 25 ? nodata : std::round(Land(col, row));
      });
      spec.type = "Int16";
      spec.nodata.reset();
      const std::string whole = WriteRaster(dir, spec), moved = dir.File("moved.tif");
      const std::string left = std::to_string(part(random)), top = std::to_string(part(random));
      SCOPED_TRACE(testing::Message() << nodata << ' ' << kernel << ' ' << left << ' ' << top);
      std::vector<const char*> words = {"-srcwin",  left.c_str(), top.c_str(), "198", "198",
                                        "-outsize", "198",        "198",       "-r",  kernel};
      words.push_back(nullptr);
      {
        GDALTranslateOptions* const options = GDALTranslateOptionsNew(const_cast<char**>(words.data()), nullptr);
        const GDALDatasetUniquePtr from(GDALDataset::Open(whole.c_str()));
        const GDALDatasetUniquePtr to(
            GDALDataset::FromHandle(GDALTranslate(moved.c_str(), GDALDataset::ToHandle(from.get()), options, nullptr)));
        GDALTranslateOptionsFree(options);
        ASSERT_NE(to, nullptr);
        to->GetRasterBand(1)->SetNoDataValue(nodata);
      }
      const auto source = OpenOrFail(moved);
      ASSERT_NE(source, nullptr);
      EXPECT_GE(InfoOf(*source).heights.min, 999) << InfoOf(*source).found_voids;
      EXPECT_LE(InfoOf(*source).heights.max, 1401) << InfoOf(*source).found_voids;
    }
  }
}

TEST(UndeclaredNodata, AnUndeclaredVoidOfARealRasterIsServedLikeADeclaredOne) {
  TERRACE_REQUIRE_DATA(path, "srtm3_N46E008_swiss_alps.tif");
  const TempDir dir;
  // The same samples; the file declares another value.
  const GDALDatasetUniquePtr original(GDALDataset::Open(path.c_str()));
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  {
    const GDALDatasetUniquePtr copy(
        driver->CreateCopy(dir.File("alps.tif").c_str(), original.get(), FALSE, nullptr, nullptr, nullptr));
    copy->GetRasterBand(1)->SetNoDataValue(-9999);
  }
  const auto declared = OpenOrFail(path), found = OpenOrFail(dir.File("alps.tif"));
  ASSERT_TRUE(declared && found);
  EXPECT_GT(InfoOf(*declared).void_samples, 100'000u);
  EXPECT_EQ(InfoOf(*found).void_samples, InfoOf(*declared).void_samples);
  for (const int level : {6, 10, 12}) {
    for (const geo::TileKey& key : SomeTiles(*declared, level, 6)) {
      const auto a = declared->Read(key), b = found->Read(key);
      ASSERT_TRUE(a && b);
      ASSERT_EQ(a->heights, b->heights) << geo::ToString(key);
    }
  }
}

// Overviews that average voids as heights.

RasterSpec WithOverviews(double nodata, const std::string& type = "Float32") {
  RasterSpec spec = Synthetic([nodata](int col, int row) {
    return std::hypot(col - 100, row - 100) < 60 ? std::round(Land(col, row)) : nodata;
  });
  spec.type = type;
  spec.nodata.reset();
  spec.overviews = {2, 4, 8};
  return spec;
}

void ExpectUnused(const std::string& path, const SourceOptions& options, const std::string& why) {
  const auto source = OpenOrFail(path, {.source = options, .floor = 1000});
  ASSERT_NE(source, nullptr);
  EXPECT_NE(InfoOf(*source).overviews_unused.find(why), std::string::npos) << InfoOf(*source).overviews_unused;
  EXPECT_TRUE(InfoOf(*source).overview_factors.empty());
  ExpectHeightsWithin(*source, 1000, 1400);
}

TEST(Overviews, OfSamplesThatTheConfigurationCallsVoidsAreNotUsed) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, WithOverviews(500));
  ExpectUnused(path, {.vertical = "unknown", .nodata = {500}}, "`nodata` of the configuration");
  const auto trusted = OpenOrFail(path, {.source = {.vertical = "unknown"}});
  ASSERT_NE(trusted, nullptr);
  EXPECT_EQ(InfoOf(*trusted).overview_factors, (std::vector<int>{2, 4, 8}));
  EXPECT_EQ(InfoOf(*trusted).overviews_unused, "");

  RasterSpec declared = WithOverviews(500);
  declared.nodata = 500;  // a value that both the file and the options state is declared
  const auto both =
      OpenOrFail(WriteRaster(dir, declared, "declared.tif"), {.source = {.vertical = "unknown", .nodata = {500}}});
  ASSERT_NE(both, nullptr);
  EXPECT_EQ(InfoOf(*both).overviews_unused, "");
}

TEST(Overviews, OfUndeclaredVoidsAreNotUsed) {
  const TempDir dir;
  ExpectUnused(WriteRaster(dir, WithOverviews(-32768, "Int16")), {.vertical = "unknown"}, "not declared");
  RasterSpec whole = WithOverviews(1100, "Int16");  // without voids no declaration is needed
  const auto source = OpenOrFail(WriteRaster(dir, whole, "whole.tif"), {.source = {.vertical = "unknown"}});
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(InfoOf(*source).overview_factors, (std::vector<int>{2, 4, 8}));
}

// Masks everything outside of the circle with GDAL's mask, in the file or in a separate one, before or after the
// overviews are made.
std::string WriteMasked(const TempDir& dir, bool inside, bool overviews_first, const std::string& type = "Float32",
                        const char* resampling = "AVERAGE", RasterSpec spec = WithOverviews(0)) {
  spec.type = type;
  if (!overviews_first) spec.overviews.clear();
  const std::string path = WriteRaster(dir, spec, inside ? "inside.tif" : "beside.tif");
  CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", inside ? "YES" : "NO");
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    EXPECT_EQ(dataset->CreateMaskBand(GMF_PER_DATASET), CE_None);
    for (int row = 0; row < spec.height; ++row) {
      std::vector<std::uint8_t> line;
      for (int col = 0; col < spec.width; ++col) line.push_back(spec.value(col, row) > 0 ? 255 : 0);
      EXPECT_EQ(dataset->GetRasterBand(1)->GetMaskBand()->RasterIO(GF_Write, 0, row, spec.width, 1, line.data(),
                                                                   spec.width, 1, GDT_Byte, 0, 0, nullptr),
                CE_None);
    }
  }
  if (!overviews_first) {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    const std::vector<int> factors = {2, 4, 8};
    EXPECT_EQ(dataset->BuildOverviews(resampling, 3, factors.data(), 0, nullptr, GDALDummyProgress, nullptr), CE_None);
  }
  CPLSetConfigOption("GDAL_TIFF_INTERNAL_MASK", nullptr);
  return path;
}

TEST(Overviews, WithoutTheMaskOfTheRasterAreNotUsed) {
  const TempDir dir;
  ExpectUnused(WriteMasked(dir, false, false), {.vertical = "unknown"}, "the mask in a file of its own");
  const TempDir other;
  ExpectUnused(WriteMasked(other, true, true), {.vertical = "unknown"}, "heights that the raster has not");
}

// The masked 0 is near the lowest height of the raster, but far from those around it.
TEST(Overviews, WithoutTheMaskAreNotUsedAlsoIfTheirHeightsAreWithinTheRange) {
  const TempDir dir;
  RasterSpec spec = WithOverviews(0);
  spec.width = spec.height = 512;
  spec.value = [](int col, int row) { return std::hypot(col - 400, row - 256) < 60 ? 0 : 100 + 8.0 * col; };
  const auto source = OpenOrFail(WriteMasked(dir, true, true, "Float32", "AVERAGE", spec));
  ASSERT_NE(source, nullptr);
  EXPECT_TRUE(InfoOf(*source).overview_factors.empty());
  EXPECT_NE(InfoOf(*source).overviews_unused.find("heights that the raster has not"), std::string::npos);
}

// Int16 always has a nodata value, and a cubic kernel slightly exceeds the range of its input.
TEST(Overviews, WithTheMaskOfTheRasterAreUsed) {
  for (const std::string type : {"Float32", "Int16", "UInt16"}) {
    for (const char* resampling : {"AVERAGE", "CUBIC", "NEAREST"}) {
      SCOPED_TRACE(type + ' ' + resampling);
      const TempDir dir;
      const auto source = OpenOrFail(WriteMasked(dir, true, false, type, resampling),
                                     {.source = {.vertical = "unknown"}, .floor = 1000});
      ASSERT_NE(source, nullptr);
      EXPECT_EQ(InfoOf(*source).overview_factors, (std::vector<int>{2, 4, 8}));
      EXPECT_EQ(InfoOf(*source).overviews_unused, "");
      ExpectHeightsWithin(*source, 990, 1410);
    }
  }
}

}  // namespace
}  // namespace terrace::dem

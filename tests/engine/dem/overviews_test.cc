// Overviews of rasters whose sides are not multiples of the factors: heights are at the right positions.
#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "engine/crs/level_plan.h"
#include "engine/raster/raster_layout.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/source_fixture.h"

namespace terrace::dem {
namespace {

constexpr double kPixel = 1 / 120.0;
// Slope of the ramps in metres a pixel along both axes, and the permitted error: a 64th of a sample of factor 16,
// because averages of averages of few samples have a small error.
constexpr double kAcross = 4, kDown = 16, kSlack = 5;

double Ramp(double column, double row) { return kAcross * column + kDown * row; }

// The first pixel is the ramp's at column `west`; its centre is `west` pixels east of 10 degrees.
RasterSpec RampSpec(int width, int height, int west = 0) {
  RasterSpec spec{.width = width, .height = height, .overviews = {2, 4, 8, 16}};
  spec.geo_transform = {10 + (west - .5) * kPixel, kPixel, 0, 47 + .5 * kPixel, 0, -kPixel};
  spec.value = [west](int column, int row) { return Ramp(west + column, row); };
  return spec;
}

TEST(OverviewAxis, PutsBlocksBetweenTheSamplesAroundTheirCentres) {
  const OverviewAxis even(GridAxis(32, 4, false), 32, 8, false);
  for (const int block : {0, 3, 7}) {
    EXPECT_EQ(even.Around(block).index, block);
    EXPECT_EQ(even.Around(block).weight, 0);
  }
  // Three samples of 3 pixels each, with centres 1.5, 4.5 and 7.5, for blocks of 4 with centres 2, 6 and 8.5.
  const OverviewAxis odd(GridAxis(9, 4, false), 9, 3, false);
  EXPECT_EQ(odd.Around(0).index, 0);
  EXPECT_DOUBLE_EQ(odd.Around(0).weight, .5 / 3);
  EXPECT_EQ(odd.Around(1).index, 1);
  EXPECT_DOUBLE_EQ(odd.Around(1).weight, .5);
  EXPECT_EQ(odd.Around(2).index, 2);
  EXPECT_EQ(odd.Around(2).weight, 0);
  const OverviewAxis around(GridAxis(9, 4, true), 9, 3, false);  // the first sample again at 10.5
  EXPECT_EQ(around.Around(2).index, 2);
  EXPECT_DOUBLE_EQ(around.Around(2).weight, 1.0 / 3);
  // Column 8 is column 0 again, but samples count it as a further column: the first again at 9.5.
  const OverviewAxis twice(GridAxis(8, 4, true), 9, 3, false);
  EXPECT_EQ(twice.Around(1).index, 1);
  EXPECT_DOUBLE_EQ(twice.Around(1).weight, .5);
  const OverviewAxis own(GridAxis(9, 4, false), 9, 3, true);
  EXPECT_EQ(own.Around(1).index, 1);
  EXPECT_EQ(own.Around(1).weight, 0);
}

// First JPEG's own overviews of whole blocks, then GDAL's in a separate file.
TEST(Overviews, OfAFormatStandForWholeBlocks) {
  const TempDir dir;
  RasterSpec spec{.width = 1001, .height = 300, .type = "Byte"};
  spec.value = [](int column, int) { return column / 4; };
  const GDALDatasetUniquePtr original(GDALDataset::Open(WriteRaster(dir, spec).c_str()));
  const std::string path = dir.File("dem.jpg");
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("JPEG");
  ASSERT_NE(driver, nullptr);
  GDALClose(driver->CreateCopy(path.c_str(), original.get(), 0, nullptr, nullptr, nullptr));
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
    ASSERT_EQ(OverviewFactors(*dataset->GetRasterBand(1)), (std::vector<int>{2, 4}));
    EXPECT_TRUE(HasOwnOverviews(*dataset));
    EXPECT_EQ(PixelsPerSample(*dataset, 4, 1001, 251), 4);
    RasterLayout layout;
    layout.width = layout.columns = 1001;
    layout.height = 300;
    layout.rules = SampleRules::Of(*dataset->GetRasterBand(1), "");
    layout.overview_factors = {4};
    const auto heights = ReadAverages(*dataset, layout, 4, {240, 10, 1, 1}, {});
    ASSERT_TRUE(heights);
    EXPECT_NEAR((*heights)[0], 240, 1);
  }
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
  int factor = 4;
  ASSERT_EQ(dataset->BuildOverviews("AVERAGE", 1, &factor, 0, nullptr, GDALDummyProgress, nullptr), CE_None);
  const GDALDatasetUniquePtr again(GDALDataset::Open(path.c_str()));
  EXPECT_FALSE(HasOwnOverviews(*again));
  EXPECT_EQ(PixelsPerSample(*again, 4, 1001, 251), 1001 / 251.0);
}

TEST(Overviews, BlocksLieWhereTheyLieWithout) {
  for (const auto& [width, height] : {std::pair{361, 241}, {360, 241}, {353, 255}, {368, 240}}) {
    SCOPED_TRACE(width);
    const TempDir dir;
    const auto source = OpenRasterOrFail(WriteRaster(dir, RampSpec(width, height)));
    ASSERT_NE(source, nullptr);
    ASSERT_EQ(source->layout().overview_factors, (std::vector<int>{2, 4, 8, 16}));
    for (const int factor : {2, 4, 8, 16, 32}) {
      const GridAxis columns(width, factor, false), rows(height, factor, false);
      const auto read = source->ReadAverages(factor, {0, 0, columns.count(), rows.count()}, {});
      ASSERT_TRUE(read);
      for (std::int64_t r = 0; r < rows.count(); ++r) {
        for (std::int64_t c = 0; c < columns.count(); ++c) {
          const double truth = Ramp(columns.Center(c) - .5, rows.Center(r) - .5);
          // The centre of the last block may be beyond the last sample's, by less than half a sample.
          const double beyond_x = c + 1 == columns.count() && width % factor != 0 ? kAcross * factor / 2 : 0;
          const double beyond_y = r + 1 == rows.count() && height % factor != 0 ? kDown * factor / 2 : 0;
          ASSERT_NEAR((*read)[static_cast<std::size_t>(r * columns.count() + c)], truth, kSlack + beyond_x + beyond_y)
              << "factor " << factor << " block " << c << ", " << r;
        }
      }
    }
  }
}

// A raster and overviews of any size that count their reads. Heights are columns of the raster, at the resolution of
// each overview.
class CountingDataset : public GDALDataset {
 public:
  class Band : public GDALRasterBand {
   public:
    Band(GDALDataset* dataset, int pixels, int width, int height) : pixels_(pixels) {
      poDS = dataset;
      nBand = 1;
      nRasterXSize = width;
      nRasterYSize = height;
      eDataType = GDT_Float32;
      nBlockXSize = nBlockYSize = 16;
    }
    CPLErr IReadBlock(int column, int, void* out) override {
      ++blocks_read;
      const double pixels = static_cast<double>(pixels_) / nRasterXSize;
      for (int i = 0; i < 256; ++i) {
        static_cast<float*>(out)[i] = static_cast<float>((column * 16 + i % 16 + 0.5) * pixels);
      }
      return CE_None;
    }
    int GetOverviewCount() override { return static_cast<int>(overviews.size()); }
    GDALRasterBand* GetOverview(int i) override { return overviews[static_cast<std::size_t>(i)].get(); }

    int blocks_read = 0;
    std::vector<std::unique_ptr<Band>> overviews;

   private:
    int pixels_;
  };

  CountingDataset(int width, int height, const std::vector<std::pair<int, int>>& overviews) {
    nRasterXSize = width;
    nRasterYSize = height;
    auto* const band = new Band(this, width, width, height);
    SetBand(1, band);
    for (const auto& [columns, rows] : overviews) {
      band->overviews.push_back(std::make_unique<Band>(this, width, columns, rows));
    }
  }
  Band& band() { return static_cast<Band&>(*GetRasterBand(1)); }
};

// A degree of SRTM with the overview sizes of cloud-optimized GeoTIFFs, of gdaladdo, and with one axis of each.
TEST(Overviews, OfSidesRoundedEitherWayAreReadInPlaceOfTheRaster) {
  GDALAllRegister();
  constexpr int kSide = 3601;
  using Sides = std::vector<std::pair<int, int>>;
  for (const Sides& sides : {Sides{{1800, 1800}, {900, 900}, {450, 450}}, Sides{{1801, 1801}, {901, 901}, {451, 451}},
                             Sides{{1801, 1800}, {900, 901}, {450, 451}}}) {
    SCOPED_TRACE(sides[0].second);
    CountingDataset dataset(kSide, kSide, sides);
    RasterLayout layout;
    layout.width = layout.columns = layout.height = kSide;
    layout.rules = SampleRules::Of(dataset.band(), "");
    layout.overview_factors = OverviewFactors(dataset.band());
    ASSERT_EQ(layout.overview_factors, (std::vector<int>{2, 4, 8}));
    // Level 8 of such a source.
    const int factor = AveragingFactor(SamplesPerCell({8, 256}, {30, 30, 30, 0.5, true}));
    ASSERT_EQ(factor, 8);
    const GridAxis blocks(kSide, factor, false);
    const auto heights = ReadAverages(dataset, layout, factor, {0, 0, blocks.count(), blocks.count()}, {});
    ASSERT_TRUE(heights);
    EXPECT_EQ(dataset.band().blocks_read, 0);
    EXPECT_EQ(dataset.band().overviews[0]->blocks_read + dataset.band().overviews[1]->blocks_read, 0);
    EXPECT_EQ(dataset.band().overviews[2]->blocks_read, 29 * 29);
    for (std::int64_t c = 0; c < blocks.count(); ++c) {
      // Heights beyond the last sample's centre are extrapolated.
      const double last = kSide - 0.5 * kSide / sides[2].first;
      ASSERT_NEAR((*heights)[static_cast<std::size_t>(7 * blocks.count() + c)],
                  std::clamp(blocks.Center(c), kSide - last, last), 1e-3)
          << c;
    }
  }
}

TEST(Overviews, OfOtherSidesAreLeftAlone) {
  CountingDataset dataset(3601, 3601, {{1799, 1800}, {1802, 1801}, {1800, 1799}, {1200, 1200}});
  EXPECT_TRUE(OverviewFactors(dataset.band()).empty());
}

// The largest distance of heights from the ramp, at nodes at least `margin` pixels inside.
double LargestOff(const ElevationModel& model, int level, int width, int height, double margin) {
  const geo::Lattice lattice = model.LatticeOf(level);
  const double step = lattice.StepDegrees();
  const auto west = static_cast<std::int64_t>(std::ceil((10 + 180) / step)),
             east = static_cast<std::int64_t>(std::floor((10 + width * kPixel + 180) / step));
  const auto south = static_cast<std::int64_t>(std::ceil((47 - height * kPixel + 90) / step)),
             north = static_cast<std::int64_t>(std::floor((47 + 90) / step));
  const NodeWindow window{west, south, static_cast<int>(east - west + 1), static_cast<int>(north - south + 1)};
  const auto heights = model.ReadNodes(level, window);
  EXPECT_TRUE(heights);
  double worst = 0;
  for (std::int64_t j = south; j <= north; ++j) {
    for (std::int64_t i = west; i <= east; ++i) {
      const double column = (lattice.Longitude(i) - 10) / kPixel, row = (47 - lattice.Latitude(j)) / kPixel;
      if (std::min({column, row, width - 1 - column, height - 1 - row}) < margin) continue;
      const float read = (*heights)[static_cast<std::size_t>((j - south) * window.columns + (i - west))];
      worst = std::max(worst, std::abs(read - Ramp(column, row)));
    }
  }
  return worst;
}

// Overviews written by GDAL: heights are at the right positions.
TEST(Overviews, OfCloudOptimizedGeoTiffsShowTheGroundWhereItIs) {
  const TempDir dir;
  RasterSpec spec = RampSpec(1001, 777);
  spec.overviews = {};
  const std::string path = dir.File("cog.tif");
  {
    const GDALDatasetUniquePtr original(GDALDataset::Open(WriteRaster(dir, spec).c_str()));
    GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("COG");
    ASSERT_NE(driver, nullptr);
    const char* const options[] = {"BLOCKSIZE=128", "OVERVIEW_RESAMPLING=AVERAGE", nullptr};
    GDALClose(driver->CreateCopy(path.c_str(), original.get(), 0, const_cast<char**>(options), nullptr, nullptr));
    const GDALDatasetUniquePtr written(GDALDataset::Open(path.c_str()));
    ASSERT_EQ(written->GetRasterBand(1)->GetOverview(0)->GetXSize(), 500);
  }
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->info().sources[0].overview_factors, (std::vector<int>{2, 4, 8}));
  EXPECT_EQ(source->info().sources[0].overviews_unused, "");
  for (int level = 2; level <= 7; ++level) {
    EXPECT_LT(LargestOff(*source, level, 1001, 777, level < 3 ? 34 : 17), kSlack) << level;
  }
}

TEST(Overviews, AWindowChangesNoBlock) {
  for (const bool around : {false, true}) {
    const TempDir dir;
    RasterSpec spec{.width = 361, .height = 179, .nodata = -1, .overviews = {2, 4, 8, 16}};
    spec.geo_transform = {around ? -180.0 : 5, around ? 360.0 / 361 : .01, 0, 80, 0, around ? -.9 : -.01};
    spec.value = [](int column, int row) {
      return column % 50 < 9 && row % 40 < 9 ? -1 : 900 + 300 * std::sin(column * 1.7) * std::cos(row * 2.3);
    };
    const auto source = OpenRasterOrFail(WriteRaster(dir, spec));
    ASSERT_NE(source, nullptr);
    ASSERT_EQ(source->layout().wraps, around);
    for (const int factor : {2, 4, 8, 16, 32}) {
      const std::int64_t columns = (361 + factor - 1) / factor, rows = (179 + factor - 1) / factor;
      const auto whole = source->ReadAverages(factor, {0, 0, columns, rows}, {});
      ASSERT_TRUE(whole);
      for (std::int64_t c = around ? -3 : 0; c < columns + (around ? 3 : 0); ++c) {
        for (std::int64_t r = 0; r < rows; r += 3) {
          const auto one = source->ReadAverages(factor, {c, r, 1, 1}, {});
          ASSERT_TRUE(one);
          const float other = (*whole)[static_cast<std::size_t>(r * columns + (c + columns) % columns)];
          ASSERT_TRUE((*one)[0] == other || (std::isnan((*one)[0]) && std::isnan(other))) << factor << " " << c;
        }
      }
    }
  }
}

TEST(Overviews, ShallowTilesShowTheGroundWhereItIs) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, RampSpec(361, 241)));
  ASSERT_NE(source, nullptr);
  // Up to 42 pixels to a step.
  for (int level = 1; level <= 7; ++level) {
    EXPECT_LT(LargestOff(*source, level, 361, 241, level < 3 ? 34 : 17), kSlack) << level;
  }
}

TEST(Overviews, OfAMosaicHaveNoStepAtTheJoint) {
  // Neighbours that share a column of pixels, as SRTM's do.
  const TempDir dir;
  const std::string west = WriteRaster(dir, RampSpec(361, 241), "west.tif"),
                    east = WriteRaster(dir, RampSpec(361, 241, 360), "east.tif");
  const auto source = ElevationModel::Open(std::vector<DemFile>{{west}, {east}}, {});
  ASSERT_TRUE(source);
  for (int level = 1; level <= 7; ++level) {
    EXPECT_LT(LargestOff(**source, level, 721, 241, level < 3 ? 34 : 17), kSlack) << level;
  }
  for (const geo::TileKey& key : SomeTiles(**source, 4, 4)) {
    const auto tile = (*source)->Read(key), next = (*source)->Read(geo::Neighbour(key, 1, 0));
    ASSERT_TRUE(tile && next);
    for (int j = 0; j <= tile->lattice.cells; ++j) {
      ASSERT_EQ(tile->At(tile->lattice.cells, j), next->At(0, j)) << geo::ToString(key);
    }
  }
}

// Averages of heights and of voids, at every overview.
RasterSpec SpecWithVoids(double nodata) {
  RasterSpec spec = RampSpec(361, 241);
  spec.value = [nodata](int column, int row) { return (column + row) % 50 == 7 ? nodata : 800 + column; };
  return spec;
}

void StateNodata(const std::string& path, double nodata) {
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
  ASSERT_NE(dataset, nullptr);
  ASSERT_EQ(dataset->GetRasterBand(1)->SetNoDataValue(nodata), CE_None);
}

TEST(Overviews, MadeOfVoidsAreNotUsed) {
  const TempDir dir;
  const std::string after = WriteRaster(dir, SpecWithVoids(-9999), "after.tif");
  StateNodata(after, -9999);
  RasterSpec other_value = SpecWithVoids(-9999);
  other_value.nodata = -1;
  const std::string other = WriteRaster(dir, other_value, "other.tif");
  StateNodata(other, -9999);
  // A height that no place has is a void without any statement.
  const std::string unstated = WriteRaster(dir, SpecWithVoids(-99999), "unstated.tif");
  for (const auto& [path, why] :
       {std::pair{after, "stated its nodata value"}, {other, "stated its nodata value"}, {unstated, "of its voids"}}) {
    const auto source = OpenRasterOrFail(path);
    ASSERT_NE(source, nullptr);
    EXPECT_TRUE(source->layout().overview_factors.empty()) << path;
    EXPECT_NE(source->info().overviews_unused.find(why), std::string::npos) << source->info().overviews_unused;
    const auto heights = source->ReadAverages(8, {0, 0, 46, 31}, {});
    ASSERT_TRUE(heights);
    EXPECT_GE(*std::ranges::min_element(*heights), 800) << path;
  }
}

// Programs that write samples do not write the overviews anew.
TEST(Overviews, OlderThanTheSamplesAreNotUsed) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, RampSpec(200, 150));
  EXPECT_EQ(OpenRasterOrFail(path)->info().overviews_unused, "");
  // A metre may be the loss of a compression.
  for (const double more_m : {1.0, 1500.0}) {
    GDALDatasetUniquePtr file(GDALDataset::Open(path.c_str(), GDAL_OF_UPDATE));
    ASSERT_NE(file, nullptr);
    std::vector<float> heights;
    for (int i = 0; i < 200 * 150; ++i) heights.push_back(static_cast<float>(Ramp(i % 200, i / 200) + more_m));
    ASSERT_EQ(file->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, 200, 150, heights.data(), 200, 150, GDT_Float32, 0, 0,
                                               nullptr),
              CE_None);
    file.reset();
    const auto raster = OpenRasterOrFail(path);
    EXPECT_EQ(raster->info().overview_factors.empty(), more_m > 1000);
    EXPECT_EQ(raster->info().overviews_unused.find("as if these were changed later") != std::string::npos,
              more_m > 1000)
        << raster->info().overviews_unused;
  }
}

// Kernels with negative weights exceed the range of heights beside cliffs. It does not mean that voids were averaged.
TEST(Overviews, OfCliffsByKernelsThatOvershootAreUsed) {
  for (const char* resampling : {"AVERAGE", "CUBIC", "LANCZOS"}) {
    const TempDir dir;
    RasterSpec spec = RampSpec(361, 241);
    spec.nodata = -9999;
    spec.overviews = {};
    spec.value = [](int column, int row) {
      if (column < 40 && row < 40) return -9999;
      return (column / 30 + row / 30) % 2 == 0 ? 0 : 100;
    };
    const std::string path = WriteRaster(dir, spec);
    {
      const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
      const std::vector<int> factors = {2, 4, 8};
      ASSERT_EQ(dataset->BuildOverviews(resampling, 3, factors.data(), 0, nullptr, GDALDummyProgress, nullptr),
                CE_None);
    }
    const auto source = OpenRasterOrFail(path);
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->layout().overview_factors, (std::vector<int>{2, 4, 8})) << source->info().overviews_unused;
  }
}

TEST(Overviews, OfARasterThatStatesItsVoidsOrHasNoneAreUsed) {
  const TempDir dir;
  RasterSpec before = SpecWithVoids(-9999);
  before.nodata = -9999;
  const std::string without = WriteRaster(dir, RampSpec(361, 241), "without.tif");
  StateNodata(without, -9999);
  for (const std::string& path : {WriteRaster(dir, before, "before.tif"), without}) {
    const auto source = OpenRasterOrFail(path);
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->layout().overview_factors, (std::vector<int>{2, 4, 8, 16})) << source->info().overviews_unused;
  }
}

// 3,601 samples a side: most of a tile is the same as without overviews, within the difference that other averages make
// on steep ground.
TEST(Overviews, OfRealGroundChangeLittle) {
  TERRACE_REQUIRE_DATA(path, "srtm1_N20W157_maui_se_haleakala.tif");
  const TempDir dir;
  const std::string copy = dir.File("copy.tif");
  std::filesystem::copy_file(path, copy);
  std::filesystem::permissions(copy, std::filesystem::perms::owner_write, std::filesystem::perm_options::add);
  GDALAllRegister();  // GDAL is not initialized yet if this test runs alone
  {
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(copy.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
    ASSERT_NE(dataset, nullptr);
    std::array<int, 4> factors = {2, 4, 8, 16};
    ASSERT_EQ(dataset->BuildOverviews("AVERAGE", 4, factors.data(), 0, nullptr, GDALDummyProgress, nullptr), CE_None);
  }
  const auto without = OpenOrFail(path), with = OpenOrFail(copy);
  ASSERT_TRUE(without && with);
  ASSERT_EQ(with->info().sources[0].overview_factors, (std::vector<int>{2, 4, 8, 16}));
  for (const int level : {7, 8, 9}) {
    std::vector<float> differences;
    for (const geo::TileKey& key : SomeTiles(*without, level, 9)) {
      const auto expected = without->Read(key), read = with->Read(key);
      ASSERT_TRUE(expected && read);
      for (std::size_t i = 0; i < expected->heights.size(); ++i) {
        if (expected->heights[i] <= 1) continue;  // the sea, and beside the raster
        differences.push_back(std::abs(expected->heights[i] - read->heights[i]));
      }
    }
    ASSERT_GT(differences.size(), 1000u);
    std::ranges::sort(differences);
    EXPECT_LT(differences[differences.size() / 2], 3) << level;
    EXPECT_LT(differences[differences.size() * 9 / 10], 15) << level;
  }
}

}  // namespace
}  // namespace terrace::dem

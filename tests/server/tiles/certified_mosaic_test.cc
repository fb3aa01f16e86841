// The certified error of mosaics against the truth: real tiles of one product over a coarse base, above the ellipsoid
// and above EGM96; and rasters whose samples lie at lattice nodes, where what a feather blends can be read sample by
// sample.
#include <gdal_priv.h>
#include <gdal_utils.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/dem/geoid.h"
#include "server/tiles/tile_pipeline.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/server/tiles/fetched_tile.h"
#include "tests/server/tiles/tile_surface.h"
#include "tests/support/test_data.h"

namespace terrace::server {
namespace {

Dataset OpenMosaic(std::vector<dem::DemFile> files, const dem::DemOptions& options) {
  Dataset dataset;
  dataset.name = "mosaic";
  auto source = dem::DemSource::Open(std::move(files), options);
  EXPECT_TRUE(source.has_value()) << (source ? "" : source.error().message);
  if (source) dataset.source = *std::move(source);
  if (dataset.source) dataset.generation = dataset.source->fingerprint();
  return dataset;
}

// Random tiles of levels that see the area, each against the samples in it; the ratios of certified to true error.
void ExpectCertified(const char* what, Dataset dataset, const std::vector<Sample>& samples, double most_in_median) {
  ASSERT_NE(dataset.source, nullptr);
  std::vector<Dataset> datasets;
  datasets.push_back(std::move(dataset));
  const TilePipeline pipeline(std::move(datasets));
  const dem::DemSource& source = *pipeline.datasets().front().source;
  std::mt19937 random(11);
  std::vector<double> ratios;
  for (int i = 0; i < 60; ++i) {
    const int level = i % (source.max_level() + 1);
    const Sample& at = samples[random() % samples.size()];
    const double side = 180.0 / static_cast<double>(geo::TileRows(level));
    TileRequest request;
    request.key = {level, static_cast<std::int64_t>(std::floor((at.longitude + 180) / side)),
                   static_cast<std::int64_t>(std::floor((at.latitude + 90) / side))};
    request.error_step = static_cast<int>(random() % 25) - 8;
    if (!source.IsAvailable(request.key)) continue;
    const FetchedTile tile = FetchTile(pipeline, request);
    ASSERT_TRUE(tile.encoded.certified_error_m.has_value());
    const double truth = TileSurface(tile.mesh, request.key).LargestError(samples);
    const double certified = *tile.encoded.certified_error_m;
    EXPECT_GE(certified, truth) << what << " " << geo::ToString(request.key) << " step " << request.error_step;
    if (truth > 0) ratios.push_back(certified / truth);
    if (std::getenv("TERRACE_PRINT_TILES") != nullptr) {
      std::printf("  %s step %d: max %.4g, certified %.4g, true %.4g, ratio %.3f\n", geo::ToString(request.key).c_str(),
                  request.error_step, tile.encoded.max_error_m, certified, truth, certified / truth);
    }
  }
  std::ranges::sort(ratios);
  ASSERT_GE(ratios.size(), 30u) << what;
  const double median = ratios[ratios.size() / 2];
  std::printf("%-34s %zu tiles, certified / true error: median %.2f, 90 %% %.2f, largest %.2f\n", what, ratios.size(),
              median, ratios[ratios.size() * 9 / 10], ratios.back());
  EXPECT_LE(median, most_in_median) << what;
}

// The corners of four tiles of one degree around the place where they meet.
constexpr int kSide = 641;
constexpr std::array<std::pair<const char*, std::array<int, 2>>, 4> kCorners = {{
    {"srtm1_N21W158_maui_nw_molokai.tif", {3601 - kSide, 3601 - kSide}},
    {"srtm1_N21W157_maui_ne_molokai.tif", {0, 3601 - kSide}},
    {"srtm1_N20W158_maui_sw.tif", {3601 - kSide, 0}},
    {"srtm1_N20W157_maui_se_haleakala.tif", {0, 0}},
}};

void Cut(const std::string& from, const std::string& to, const std::array<int, 2>& corner) {
  GDALAllRegister();
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(from.c_str(), GDAL_OF_RASTER));
  ASSERT_NE(dataset, nullptr);
  std::vector<std::string> words = {"-srcwin", std::to_string(corner[0]), std::to_string(corner[1]),
                                    std::to_string(kSide), std::to_string(kSide)};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  GDALTranslateOptions* const options = GDALTranslateOptionsNew(arguments.data(), nullptr);
  GDALDatasetH cut = GDALTranslate(to.c_str(), dataset.get(), options, nullptr);
  GDALTranslateOptionsFree(options);
  ASSERT_NE(cut, nullptr);
  GDALClose(cut);
}

void AddOverviews(const std::string& path) {
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
  ASSERT_NE(dataset, nullptr);
  std::array<int, 4> factors = {2, 4, 8, 16};
  EXPECT_EQ(dataset->BuildOverviews("AVERAGE", 4, factors.data(), 0, nullptr, GDALDummyProgress, nullptr), CE_None);
}

// More sheets than are asked about whole windows, each on a grid of its own.
TEST(CertifiedMosaic, ManySmallSheets) {
  const dem::TempDir dir;
  std::vector<dem::DemFile> files;
  std::vector<Sample> samples;
  for (int k = 0; k < 16; ++k) {
    dem::RasterSpec spec;
    spec.width = 60;
    spec.height = 50;
    const double step = 0.01 + 0.0001 * k;
    spec.geo_transform = {10.0 + 0.8 * (k % 4), step, 0, 40.0 + 0.8 * (k / 4), 0, -step};
    spec.value = [k](int x, int y) {
      return 900 + 300 * std::sin(0.2 * x + k) * std::cos(0.13 * y) + (x * 7 + y * 11) % 17;
    };
    files.push_back({dem::WriteRaster(dir, spec, "s" + std::to_string(k) + ".tif")});
    for (const Sample& sample : SamplesOf(files.back().path)) samples.push_back(sample);
  }
  ExpectCertified("sixteen small rasters", OpenMosaic(files, {}), samples, 3);
}

TEST(CertifiedMosaic, RealTilesOverACoarseBase) {
  const auto base = test_support::TestDataPath("etopo5_global_10min.tif");
  if (!base) GTEST_SKIP() << test_support::MissingTestData("etopo5_global_10min.tif");
  const dem::TempDir dir;
  std::vector<dem::DemFile> files;
  std::vector<Sample> samples;
  double west = 180, south = 90, east = -180, north = -90;
  for (const auto& [name, corner] : kCorners) {
    const auto path = test_support::TestDataPath(name);
    if (!path) GTEST_SKIP() << test_support::MissingTestData(name);
    files.push_back({dir.File(name), 0});
    Cut(*path, files.back().path, corner);
    for (const Sample& sample : SamplesOf(files.back().path)) {
      samples.push_back(sample);
      west = std::min(west, sample.longitude), east = std::max(east, sample.longitude);
      south = std::min(south, sample.latitude), north = std::max(north, sample.latitude);
    }
  }
  files.push_back({*base, 1});
  for (const Sample& sample : SamplesOf(*base)) {
    const bool is_hidden =
        sample.longitude >= west && sample.longitude <= east && sample.latitude >= south && sample.latitude <= north;
    if (!is_hidden && std::abs(sample.longitude + 157) < 20 && std::abs(sample.latitude - 21) < 20) {
      samples.push_back(sample);
    }
  }
  dem::DemOptions options;
  ExpectCertified("four tiles over a base", OpenMosaic(files, options), samples, 3);
  // Of 641 samples, which no factor divides.
  for (const dem::DemFile& file : files) {
    if (file.rank == 0) AddOverviews(file.path);
  }
  ExpectCertified("the same with overviews", OpenMosaic(files, options), samples, 3);
  for (const std::size_t one : {0, 3}) {
    ExpectCertified("one with overviews", OpenMosaic({files[one]}, options), SamplesOf(files[one].path), 3);
  }
  options.source.vertical = "egm96";
  const auto geoid = dem::Geoid::OfCrs("EPSG:5773", {-157, 21});
  ASSERT_TRUE(geoid.has_value());
  const dem::Geoid::Reader reader(**geoid);
  for (Sample& sample : samples) sample.height += reader.At({sample.longitude, sample.latitude});
  ExpectCertified("the same above EGM96", OpenMosaic(files, options), samples, 3);
}

// Samples of all rasters lie at nodes of level 12, those of the base at every 16th.
constexpr int kLevel = 12, kPieces = 512, kBase = 16, kRim = 512;  // nodes
constexpr double kStep = 180.0 / 4096 / 256;
constexpr std::int64_t kFirstColumn = 1088 * 256, kFirstRow = 2800 * 256;

double Ground(double column, double row) {
  return 900 + 500 * std::sin(column * .013) * std::cos(row * .011) + 30 * std::sin(column * .31 + row * .17);
}
bool IsHole(int column, int row) { return std::hypot(column - 300, row - 420) < 90; }

class Aligned {
 public:
  // Two pieces side by side with a hole, over a base that lies beyond them on all sides.
  Aligned() {
    for (int piece = 0; piece < 2; ++piece) {
      const int left = piece * kPieces;
      pieces_.push_back(Write("piece" + std::to_string(piece) + ".tif", left, 0, kPieces, 1,
                              [left](int c, int r) { return IsHole(left + c, r) ? -9999 : Ground(left + c, r); }));
    }
    // Of another survey: 25 m off, and it knows no hills.
    base_ = Write("base.tif", -kRim, -kRim, (2 * kPieces + 2 * kRim) / kBase, kBase, [](int c, int r) {
      return 25 + 900 + 500 * std::sin((c * kBase - kRim) * .013) * std::cos((r * kBase - kRim) * .011);
    });
  }

  std::vector<dem::DemFile> files() const { return {{pieces_[0], 0}, {pieces_[1], 0}, {base_, 1}}; }

  // Heights as they are served at the full resolution, at the samples that show or are blended.
  std::vector<Sample> Truth(const dem::DemSource& source) const {
    std::vector<Sample> samples;
    const geo::Lattice lattice = source.LatticeOf(kLevel);
    EXPECT_EQ(lattice.cells, 256);
    const dem::NodeWindow window{kFirstColumn - kRim, kFirstRow - kPieces - kRim, 2 * kPieces + 2 * kRim,
                                 kPieces + 2 * kRim};
    const auto heights = source.ReadNodes(kLevel, window);
    EXPECT_TRUE(heights.has_value());
    for (int y = kBase; y < window.rows - kBase; ++y) {
      for (int x = 0; x < window.columns - kBase; ++x) {
        const int column = x - kRim, row = kPieces + kRim - y;  // of the pieces' samples, from the north
        const bool is_piece = column >= 0 && column < 2 * kPieces && row >= 0 && row < kPieces && !IsHole(column, row);
        if (!is_piece && (column % kBase != 0 || row % kBase != 0)) continue;
        samples.push_back({lattice.Longitude(window.column + x), lattice.Latitude(window.row + y),
                           (*heights)[static_cast<std::size_t>(y) * static_cast<std::size_t>(window.columns) +
                                      static_cast<std::size_t>(x)]});
      }
    }
    return samples;
  }

 private:
  // Its first sample lies at a column east and a row south of the pieces' first.
  std::string Write(const std::string& name, int column, int row, int size, int spacing,
                    std::function<double(int, int)> value) const {
    dem::RasterSpec spec;
    spec.width = size;
    spec.height = spacing == 1 ? size : (kPieces + 2 * kRim) / kBase;
    const double step = kStep * spacing;
    spec.geo_transform = {static_cast<double>(kFirstColumn + column) * kStep - 180 - step / 2, step, 0,
                          static_cast<double>(kFirstRow - row) * kStep - 90 + step / 2,        0,    -step};
    spec.nodata = -9999;
    spec.value = std::move(value);
    return dem::WriteRaster(dir_, spec, name);
  }

  dem::TempDir dir_;
  std::vector<std::string> pieces_;
  std::string base_;
};

TEST(CertifiedMosaic, WhatAFeatherBlends) {
  const Aligned rasters;
  for (const double feather : {0.0, 400.0, 3000.0}) {
    for (const char* vertical : {"unknown", "egm96"}) {
      dem::DemOptions options;
      options.feather = feather;
      if (feather == 0) options.max_void_gap = 0;  // what is filled is no sample, and blended with none
      options.source.vertical = vertical;
      Dataset dataset = OpenMosaic(rasters.files(), options);
      ASSERT_NE(dataset.source, nullptr);
      const std::vector<Sample> samples = rasters.Truth(*dataset.source);
      const std::string what = fmt::format("feather {:.0f} m, {}", feather, vertical);
      // Half of these tiles lie in the widest feather, where each raster is judged on its own.
      ExpectCertified(what.c_str(), std::move(dataset), samples, feather < 1000 ? 3 : 3.5);
    }
  }
}

}  // namespace
}  // namespace terrace::server

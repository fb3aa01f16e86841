// Statistics of rasters and their cache: equal heights with and without it, continued after interruptions, shared, and
// rejected if damaged.
#include "engine/sources/prepare.h"

#include <gdal_priv.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <utility>

#include "engine/gdal/raster_file.h"
#include "engine/raster/grid_cells.h"
#include "engine/sources/raster_source.h"
#include "engine/statistics/cache_files.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

double Terrain(int column, int row) {
  return 1500 + 900 * std::sin(column * .004) * std::cos(row * .0031) + 40 * std::sin(column * .21 + row * .17) +
         ((column * 7919 + row * 104729) % 97) * .37;
}

// A raster without overviews that is too large to be read whole: sparse, with a few patches of terrain that have voids.
std::string WriteLargeRaster(const TempDir& dir, const std::string& name = "large.tif") {
  GDALAllRegister();
  const std::string path = dir.File(name);
  const char* const options[] = {"TILED=YES", "SPARSE_OK=TRUE", "COMPRESS=DEFLATE", nullptr};
  GDALDatasetUniquePtr dataset(GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
      path.c_str(), 6300, 4200, 1, GDT_Float32, const_cast<char**>(options)));
  std::array<double, 6> transform = {7, 1 / 1200.0, 0, 47, 0, -1 / 1200.0};
  dataset->SetGeoTransform(transform.data());
  OGRSpatialReference srs;
  srs.SetFromUserInput("EPSG:4326");
  dataset->SetSpatialRef(&srs);
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  band.SetNoDataValue(-9999);
  std::vector<float> patch(700 * 600);
  for (const auto& [left, top] : {std::pair{100, 200}, std::pair{2900, 1900}, std::pair{5600, 3600}}) {
    for (int r = 0; r < 600; ++r) {
      for (int c = 0; c < 700; ++c) {
        const bool hole = c > 300 && c < 340 && r > 200 && r < 350;
        patch[static_cast<std::size_t>(r * 700 + c)] = hole ? -9999.f : static_cast<float>(Terrain(left + c, top + r));
      }
    }
    EXPECT_EQ(band.RasterIO(GF_Write, left, top, 700, 600, patch.data(), 700, 600, GDT_Float32, 0, 0, nullptr),
              CE_None);
  }
  return path;
}

std::unique_ptr<RasterSource> OpenWithCache(const std::string& path, const std::string& cache_dir) {
  auto source = RasterSource::Open(path, {}, cache_dir.empty() ? RasterCache() : CacheIn(cache_dir));
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

// Equal bits, voids included.
bool SameHeights(const std::vector<float>& a, const std::vector<float>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](float x, float y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

void ExpectSameAverages(const std::string& path, const RasterSource& source) {
  const auto dataset = OpenRaster(path);
  ASSERT_TRUE(dataset);
  const RasterLayout& layout = source.layout();
  for (int factor = 1; factor <= 16384; factor *= 2) {
    const GridWindow whole{0, 0, (layout.columns + factor - 1) / factor, (layout.height + factor - 1) / factor};
    GridWindow part = whole;
    if (factor < 8) part = {whole.columns / 3, whole.rows / 3, whole.columns / 4, whole.rows / 4};
    const auto read = source.ReadAverages(factor, part, {});
    const auto direct = ReadAverages(**dataset, layout, factor, part, {});
    ASSERT_TRUE(read && direct);
    EXPECT_TRUE(SameHeights(*read, *direct)) << "factor " << factor;
  }
}

TEST(Prepare, AveragesFromTheCacheAreThoseOfTheSamplesBitForBit) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  const auto first = OpenWithCache(path, cache);
  EXPECT_FALSE(first->preparation().from_cache);
  EXPECT_LT(first->preparation().chunks_read, first->preparation().chunks) << "what is not stored is not read";
  ExpectSameAverages(path, *first);
  const auto second = OpenWithCache(path, cache);
  EXPECT_TRUE(second->preparation().from_cache);
  EXPECT_EQ(second->preparation().chunks_read, 0);
  ExpectSameAverages(path, *second);
  EXPECT_EQ(second->info().heights.min, first->info().heights.min);
  EXPECT_EQ(second->info().heights.max, first->info().heights.max);
  EXPECT_EQ(second->info().valid_samples, 3u * (700 * 600 - 39 * 149));
}

TEST(Prepare, StatisticsAreTheSameOnSeveralThreads) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir);
  std::vector<std::string> written;
  for (const unsigned threads : {1u, 5u}) {
    const std::string cache = dir.File("cache" + std::to_string(threads));
    double last = 0;
    const auto source = RasterSource::Open(
        path, {}, CacheIn(cache), [&](double done) { EXPECT_GT(done, std::exchange(last, done)); }, {}, nullptr,
        threads);
    ASSERT_TRUE(source) << source.error().message;
    EXPECT_EQ(last, 1);
    ExpectSameAverages(path, **source);
    for (const auto& file : std::filesystem::directory_iterator(cache)) {
      if (file.path().extension() != CacheFolder::Files::kEnding) continue;
      std::ifstream in(file.path(), std::ios::binary);
      written.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    }
  }
  ASSERT_EQ(written.size(), 2u);
  EXPECT_TRUE(written[0] == written[1]);
}

TEST(Prepare, TilesAreTheSameWithAndWithoutACache) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir);
  DemOptions options;
  const auto plain = OpenOrFail(path, options);
  options.cache = CacheIn(dir.File("cache"));
  const auto made = OpenOrFail(path, options);
  const auto loaded = OpenOrFail(path, options);
  EXPECT_EQ(plain->fingerprint(), loaded->fingerprint());
  for (int level = 0; level <= plain->max_level(); ++level) {
    for (const geo::TileKey& key : SomeTiles(*plain, level, 6)) {
      const auto expected = plain->Read(key), first = made->Read(key), second = loaded->Read(key);
      ASSERT_TRUE(expected && first && second);
      EXPECT_EQ(expected->heights, first->heights) << geo::ToString(key);
      EXPECT_EQ(expected->heights, second->heights) << geo::ToString(key);
      EXPECT_EQ(expected->source_error_m, second->source_error_m) << geo::ToString(key);
      const HeightRange a = plain->RangeBound(key), b = loaded->RangeBound(key);
      EXPECT_EQ(a.min, b.min);
      EXPECT_EQ(a.max, b.max);
    }
  }
}

// Compares every sample with the surface between averages, by reading both separately.
void ExpectErrorsHold(const std::string& path) {
  const auto source = OpenWithCache(path, {});
  const auto dataset = OpenRaster(path);
  ASSERT_TRUE(source && dataset);
  const RasterLayout& layout = source->layout();
  const auto samples = ReadAverages(**dataset, layout, 1, {0, 0, layout.columns, layout.height}, {});
  ASSERT_TRUE(samples);
  for (int factor = 2; factor / 2 < std::max(layout.width, layout.height); factor *= 2) {
    const GridAxis columns(layout.columns, factor, layout.wraps), rows(layout.height, factor, false);
    GridWindow all{layout.wraps ? -1 : 0, 0, columns.count() + (layout.wraps ? 2 : 0), rows.count()};
    const auto averages = ReadAverages(**dataset, layout, factor, all, {});
    ASSERT_TRUE(averages);
    AveragingErrors truth(layout.width, layout.height);
    const int pixels = AveragingErrors::BlockPixels(factor);
    for (int r = 0; r < layout.height; ++r) {
      for (int c = 0; c < layout.columns; ++c) {
        const float sample = (*samples)[static_cast<std::size_t>(r) * static_cast<std::size_t>(layout.columns) +
                                        static_cast<std::size_t>(c)];
        if (std::isnan(sample)) continue;
        const GridCell cell = GridAxes{columns, rows, layout.width, layout.height}.CellAt({c + .5, r + .5});
        const auto height = Interpolate(*averages, all, cell);
        if (height) truth.Raise(factor, c / pixels, r / pixels, static_cast<float>(std::abs(*height - sample)));
      }
    }
    double most = 0;
    for (std::size_t i = 0; i < truth.level(factor).errors.size(); ++i) {
      const float bound = source->statistics()->errors.level(factor).errors[i], real = truth.level(factor).errors[i];
      ASSERT_GE(bound * 1.00001 + 1e-3, real) << path << " factor " << factor << " block " << i;
      most = std::max(most, double{bound} - real);
      if (factor <= kLargestMeasuredFactor) {
        EXPECT_NEAR(bound, real, 1e-3 + 1e-5 * real) << path << " factor " << factor;
      }
    }
  }
}

TEST(Prepare, ErrorsOfAveragesHoldForEverySample) {
  const TempDir dir;
  RasterSpec spec;
  spec.width = 1300;
  spec.height = 700;
  spec.geo_transform = {5, .001, 0, 40, 0, -.001};
  spec.nodata = -1;
  spec.value = [](int c, int r) { return (c - 600) * (c - 600) + (r - 300) * (r - 300) < 4000 ? -1 : Terrain(c, r); };
  ExpectErrorsHold(WriteRaster(dir, spec, "holes.tif"));
  spec.overviews = {2, 8};
  ExpectErrorsHold(WriteRaster(dir, spec, "overviews.tif"));
  spec.width = 1301;
  spec.height = 703;
  spec.overviews = {2, 4, 8, 16, 64};
  ExpectErrorsHold(WriteRaster(dir, spec, "odd.tif"));
  RasterSpec globe;
  globe.width = 1080;
  globe.height = 540;
  globe.geo_transform = {-180, 1 / 3.0, 0, 90, 0, -1 / 3.0};
  globe.value = [](int c, int r) { return 3000 * std::sin(c * .05) * std::sin(r * .03) + c; };
  ExpectErrorsHold(WriteRaster(dir, globe, "globe.tif"));
  globe.width = 1081;
  globe.geo_transform[1] = 360.0 / 1081;
  globe.overviews = {2, 4, 8};
  ExpectErrorsHold(WriteRaster(dir, globe, "odd_globe.tif"));
}

// A child process opens the raster and is killed after this fraction; returns whether the kill ended it.
bool KilledAfter(const std::string& path, const std::string& cache, double share) {
  const pid_t child = ::fork();
  if (child == 0) {
    (void)RasterSource::Open(path, {}, CacheIn(cache), [share](double done) {
      if (done >= share) ::raise(SIGKILL);
    });
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
}

TEST(Prepare, GoesOnWhereItWasKilled) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  ASSERT_TRUE(KilledAfter(path, cache, .3));
  ASSERT_TRUE(KilledAfter(path, cache, .6)) << "twice";
  const auto source = OpenWithCache(path, cache);
  const Preparation& preparation = source->preparation();
  EXPECT_FALSE(preparation.from_cache);
  EXPECT_EQ(preparation.chunks, 35);
  EXPECT_EQ(preparation.chunks_kept, 21);
  const TempDir other;
  const auto undisturbed = OpenWithCache(path, other.path().string());
  EXPECT_LT(preparation.chunks_read, undisturbed->preparation().chunks_read);
  EXPECT_EQ(source->content(), undisturbed->content());
  ExpectSameAverages(path, *source);
  EXPECT_TRUE(OpenWithCache(path, cache)->preparation().from_cache);
}

TEST(Prepare, ThrowsAwayATornPart) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  ASSERT_TRUE(KilledAfter(path, cache, .6));
  const std::string partial = StatisticsPath(cache, path) + ".partial";
  const auto size = std::filesystem::file_size(partial);
  for (const int cut : {1, 33, 5000}) {
    std::filesystem::resize_file(partial, size - static_cast<std::uintmax_t>(cut));
    ASSERT_TRUE(KilledAfter(path, cache, .65));
  }
  const auto source = OpenWithCache(path, cache);
  EXPECT_GT(source->preparation().chunks_kept, 0);
  ExpectSameAverages(path, *source);
}

TEST(Prepare, TwoProcessesShareOneCache) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  std::array<pid_t, 3> children{};
  for (pid_t& child : children) {
    child = ::fork();
    if (child == 0) {
      const auto source = RasterSource::Open(path, {}, CacheIn(cache));
      ::_exit(source && (*source)->ReadAverages(8, {300, 200, 100, 100}, {}) ? 0 : 1);
    }
  }
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }
  const auto source = OpenWithCache(path, cache);
  EXPECT_TRUE(source->preparation().from_cache);
  ExpectSameAverages(path, *source);
  EXPECT_FALSE(std::filesystem::exists(StatisticsPath(cache, path) + ".partial"));
}

TEST(Prepare, KeepsNoFileOpenAndDoesWithoutOneThatIsGone) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  OpenWithCache(path, cache);
  const auto source = OpenWithCache(path, cache);
  EXPECT_TRUE(source->preparation().from_cache);
  const auto before = source->ReadAverages(8, {300, 200, 100, 100}, {});
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    EXPECT_FALSE(std::filesystem::read_symlink(entry, gone).string().starts_with(cache));
  }
  std::filesystem::remove_all(cache);
  const auto after = source->ReadAverages(8, {300, 200, 100, 100}, {});
  ASSERT_TRUE(before && after);
  EXPECT_TRUE(std::memcmp(before->data(), after->data(), before->size() * sizeof(float)) == 0) << "voids are NaN";
}

TEST(Prepare, RastersWhoseOverviewsMisleadAreLookedAtOnce) {
  const TempDir dir;
  RasterSpec spec{.width = 300, .height = 200, .type = "Int16", .geo_transform = {8, .01, 0, 47, 0, -.01}};
  spec.overviews = {2, 4};
  spec.value = [](int col, int row) { return col < 100 && row < 90 ? -32768 : 500 + col; };  // undeclared
  const std::string path = WriteRaster(dir, spec), cache = dir.File("cache");
  using Files = std::map<std::string, FileIdentity>;
  const auto files = [&] {
    Files written;
    for (const auto& entry : std::filesystem::directory_iterator(cache)) {
      written[entry.path().filename()] = IdentityOf(entry.path().string()).value();
    }
    return written;
  };
  const auto source = OpenWithCache(path, cache);
  EXPECT_FALSE(source->info().overviews_unused.empty());
  const Files made = files();
  EXPECT_EQ(made.size(), 2u);
  const auto again = OpenWithCache(path, cache);
  EXPECT_TRUE(again->preparation().from_cache);
  EXPECT_EQ(again->info().overviews_unused, source->info().overviews_unused);
  EXPECT_TRUE(files() == made) << "none was written anew";
  ExpectSameAverages(path, *again);
}

TEST(Prepare, NeverBelievesADamagedFile) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  OpenWithCache(path, cache);
  const std::string cache_file = StatisticsPath(cache, path);
  std::ifstream file(cache_file, std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(file)), {});
  const auto write = [&](const std::string& bytes) { std::ofstream(cache_file, std::ios::binary) << bytes; };
  std::mt19937 random(3);
  for (int i = 0; i < 12; ++i) {
    std::string bad = good;
    if (i % 4 == 0) {
      bad.resize(random() % bad.size());
    } else {
      // The header, the statistics at the end, and anywhere.
      const std::size_t at = i % 4 == 1   ? random() % 40
                             : i % 4 == 2 ? bad.size() - 1 - random() % 40000
                                          : random() % bad.size();
      bad[at] = static_cast<char>(bad[at] ^ (1 << random() % 8));
    }
    write(bad);
    const auto source = OpenWithCache(path, cache);
    ASSERT_NE(source, nullptr);
    if (i % 4 == 3) {
      ExpectSameAverages(path, *source);
    } else {
      EXPECT_FALSE(source->preparation().from_cache) << i;
    }
  }
  write(good);
  EXPECT_TRUE(OpenWithCache(path, cache)->preparation().from_cache);
}

TEST(Prepare, DamagedAveragesAreReadFromTheSourceAndMadeAnew) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir), cache = dir.File("cache");
  const auto source = OpenWithCache(path, cache);
  const std::string cache_file = StatisticsPath(cache, path);
  // Overwrites all averages, which are most of the file.
  std::fstream file(cache_file, std::ios::binary | std::ios::in | std::ios::out);
  const auto size = std::filesystem::file_size(cache_file);
  for (std::uintmax_t at = 40; at < size * 9 / 10; at += 997) {
    file.seekp(static_cast<std::streamoff>(at));
    file.put('\x5a');
  }
  file.close();
  ExpectSameAverages(path, *source);
  EXPECT_FALSE(OpenWithCache(path, cache)->preparation().from_cache);
  EXPECT_TRUE(OpenWithCache(path, cache)->preparation().from_cache);
}

TEST(Prepare, AChangedSourceIsPreparedAnew) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {}), cache = dir.File("cache");
  OpenWithCache(path, cache);
  EXPECT_TRUE(OpenWithCache(path, cache)->preparation().from_cache);
  std::filesystem::rename(WriteRaster(dir, {.value = [](int, int) { return 5.0; }}, "new.tif"), path);
  const auto source = OpenWithCache(path, cache);
  EXPECT_FALSE(source->preparation().from_cache);
  EXPECT_EQ(source->info().heights.max, 5);
}

TEST(Prepare, AFolderThatCannotBeWrittenToCostsNothingButTheCache) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  std::ofstream(dir.File("file")) << "x";
  const auto source = OpenWithCache(path, dir.File("file") + "/cache");
  ASSERT_NE(source, nullptr);
  EXPECT_FALSE(source->preparation().from_cache);
}

// Several chunks, unusable overviews, and undeclared nodata values.
std::string WriteRasterWithUndeclaredNodata(const TempDir& dir, const std::string& name = "marked.tif") {
  RasterSpec spec;
  spec.width = spec.height = 2100;
  spec.geo_transform = {8, .001, 0, 47, 0, -.001};
  spec.nodata = -1;
  spec.overviews = {4, 16};
  spec.value = [](int col, int row) { return col % 300 == 100 && row % 300 == 50 ? -32768 : Terrain(col, row); };
  return WriteRaster(dir, spec, name);
}

void ExpectNodataIsVoid(const RasterSource& source) {
  EXPECT_NE(source.info().found_voids, "");
  EXPECT_EQ(source.info().void_samples, 49u);
  EXPECT_GT(source.info().heights.min, 0);
  EXPECT_TRUE(source.layout().overview_factors.empty()) << "they were averaged from nodata values";
}

TEST(Prepare, FoundVoidsArePartOfTheFile) {
  const TempDir dir;
  const std::string path = WriteRasterWithUndeclaredNodata(dir), cache = dir.File("cache");
  const auto plain = OpenWithCache(path, {}), made = OpenWithCache(path, cache), loaded = OpenWithCache(path, cache);
  EXPECT_FALSE(made->preparation().from_cache);
  EXPECT_TRUE(loaded->preparation().from_cache);
  EXPECT_EQ(loaded->preparation().chunks_read, 0);
  for (const auto& source : {plain.get(), made.get(), loaded.get()}) {
    ExpectNodataIsVoid(*source);
    EXPECT_EQ(source->info().found_voids, plain->info().found_voids);
    EXPECT_EQ(source->info().heights.min, plain->info().heights.min);
    ExpectSameAverages(path, *source);
  }
}

TEST(Prepare, AFileIsNotUsedForOtherRules) {
  const TempDir dir;
  const std::string path = WriteRasterWithUndeclaredNodata(dir), cache = dir.File("cache");
  OpenWithCache(path, cache);
  const auto with = [&](SourceOptions options) {
    auto source = RasterSource::Open(path, options, CacheIn(cache));
    EXPECT_TRUE(source.has_value());
    return *std::move(source);
  };
  const SourceOptions trusted{.find_voids = false}, stated{.find_voids = false, .nodata = {-32768}};
  EXPECT_FALSE(with(trusted)->preparation().from_cache);
  EXPECT_EQ(with(trusted)->info().void_samples, 0u);
  EXPECT_EQ(with(trusted)->info().heights.min, -32768);
  EXPECT_FALSE(with(stated)->preparation().from_cache);
  EXPECT_EQ(with(stated)->info().void_samples, 49u);
  for (const SourceOptions& options : {trusted, stated, SourceOptions{}}) {
    EXPECT_TRUE(with(options)->preparation().from_cache) << "each way of reading a file has its file";
  }
}

TEST(Prepare, GoesOnInTheSecondPass) {
  const TempDir dir;
  const std::string path = WriteRasterWithUndeclaredNodata(dir), cache = dir.File("cache");
  const pid_t child = ::fork();
  if (child == 0) {
    double last = 0;
    int passes = 1;
    (void)RasterSource::Open(path, {}, CacheIn(cache), [&](double done) {
      if (done < last) ++passes;
      last = done;
      if (passes == 2 && done > .5) ::raise(SIGKILL);
    });
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
  const auto source = OpenWithCache(path, cache);
  EXPECT_EQ(source->preparation().chunks, 9);
  EXPECT_EQ(source->preparation().chunks_kept, 5);
  EXPECT_EQ(source->preparation().chunks_read, 4) << "the first pass is over, and the detected nodata is kept";
  ExpectNodataIsVoid(*source);
  ExpectSameAverages(path, *source);
}

TEST(Prepare, StopsWhenToldAndGoesOnNextTime) {
  const TempDir dir;
  const std::string path = WriteLargeRaster(dir);
  for (const unsigned threads : {1U, 4U}) {
    const RasterCache cache = CacheIn(dir.File("cache of " + std::to_string(threads)));
    std::stop_source stop;
    const auto told = [&](double done) {
      if (done >= .3) stop.request_stop();
    };
    const auto stopped = RasterSource::Open(path, {}, cache, told, stop.get_token(), nullptr, threads);
    ASSERT_FALSE(stopped.has_value());
    EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
    const auto source = RasterSource::Open(path, {}, cache, {}, {}, nullptr, threads);
    ASSERT_TRUE(source.has_value());
    EXPECT_FALSE((*source)->preparation().from_cache);
    EXPECT_GE((*source)->preparation().chunks_kept, 11) << threads << " threads";
    EXPECT_LT((*source)->preparation().chunks_kept, 35) << threads << " threads";
    ExpectSameAverages(path, **source);
  }
}

}  // namespace
}  // namespace terrace::dem

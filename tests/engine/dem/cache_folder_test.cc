// The folder of statistics files: its bound, which files are removed, sharing, and the fallback if it fails.
#include "engine/statistics/cache_folder.h"

#include <gdal_priv.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xxhash.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>

#include "engine/gdal/raster_file.h"
#include "engine/raster/raster_layout.h"
#include "engine/sources/prepare.h"
#include "engine/sources/raster_source.h"
#include "engine/statistics/kept_factors.h"
#include "engine/statistics/memory_averages.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

namespace fs = std::filesystem;

RasterSpec Hills(int width, int height) {
  RasterSpec spec{.width = width, .height = height, .geo_transform = {8, .001, 0, 47, 0, -.001}};
  spec.nodata = -9999;
  spec.value = [](int c, int r) { return 900 + 300 * std::sin(c * .11) * std::cos(r * .07) + (c * 31 + r * 17) % 23; };
  return spec;
}

std::unique_ptr<RasterSource> OpenIn(const std::string& path, const RasterCache& cache) {
  auto source = RasterSource::Open(path, {}, cache);
  EXPECT_TRUE(source.has_value()) << source.error().message;
  return source ? *std::move(source) : nullptr;
}

// Expects the bits of ReadAverages, which is tested against the file itself.
void ExpectAveragesOf(const std::string& path, const RasterSource& source) {
  const auto dataset = OpenRaster(path);
  ASSERT_TRUE(dataset);
  const RasterLayout& layout = source.layout();
  for (int factor = 1; factor <= 256; factor *= 2) {
    const GridWindow whole{0, 0, DivideUp(layout.columns, factor), DivideUp(layout.height, factor)};
    const auto read = source.ReadAverages(factor, whole, {});
    const auto direct = ReadAverages(**dataset, layout, factor, whole, {});
    ASSERT_TRUE(read && direct);
    ASSERT_EQ(read->size(), direct->size());
    for (std::size_t i = 0; i < read->size(); ++i) {
      ASSERT_TRUE((*read)[i] == (*direct)[i] || (std::isnan((*read)[i]) && std::isnan((*direct)[i])))
          << "factor " << factor << ", average " << i << ": " << (*read)[i] << " for " << (*direct)[i];
    }
  }
}

// Bytes of all files, including those of other programs.
std::uint64_t BytesIn(const std::string& folder) {
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder)) bytes += entry.is_regular_file() ? entry.file_size() : 0;
  return bytes;
}

void UsedAgo(const std::string& file, std::chrono::hours ago) {
  fs::last_write_time(file, fs::file_time_type::clock::now() - ago);
}

std::string ContentOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Records the log during its lifetime.
class LogText {
 public:
  LogText() : before_(spdlog::default_logger()) {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_)));
  }
  ~LogText() { spdlog::set_default_logger(before_); }
  LogText(const LogText&) = delete;
  LogText& operator=(const LogText&) = delete;

  int LinesWith(const std::string& part) const {
    std::istringstream lines(text_.str());
    int count = 0;
    for (std::string line; std::getline(lines, line);) count += line.find(part) != std::string::npos ? 1 : 0;
    return count;
  }
  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  const std::shared_ptr<spdlog::logger> before_;
};

TEST(CacheFolder, KeepsItsBoundAndDropsWhatWasNotUsedForLongest) {
  const TempDir dir;
  const std::string folder = dir.File("cache");
  std::vector<std::string> rasters, files;
  for (int i = 0; i < 5; ++i) {
    rasters.push_back(WriteRaster(dir, Hills(700, 700), std::to_string(i) + ".tif"));
    files.push_back(StatisticsPath(folder, rasters.back()));
  }
  OpenIn(rasters[0], CacheIn(folder));
  const std::uint64_t each = fs::file_size(files[0]), bound = each * 9 / 2;
  const RasterCache cache{std::make_shared<CacheFolder>(folder, bound), nullptr};
  for (int i = 1; i < 3; ++i) OpenIn(rasters[static_cast<std::size_t>(i)], cache);
  UsedAgo(files[0], std::chrono::hours(5));
  UsedAgo(files[1], std::chrono::hours(7));
  UsedAgo(files[2], std::chrono::hours(6));
  EXPECT_TRUE(OpenIn(rasters[1], cache)->preparation().from_cache) << "which is a use of it";
  for (int i = 3; i < 5; ++i) {
    OpenIn(rasters[static_cast<std::size_t>(i)], cache);
    EXPECT_LE(BytesIn(folder), bound) << i;
  }
  EXPECT_FALSE(fs::exists(files[2])) << "the oldest goes first";
  EXPECT_FALSE(fs::exists(files[0]));
  for (const int kept : {1, 3, 4}) EXPECT_TRUE(fs::exists(files[static_cast<std::size_t>(kept)])) << kept;
  EXPECT_EQ(cache.folder->problem(), "");
}

TEST(CacheFolder, LeavesAloneWhatItDidNotWrite) {
  const TempDir dir;
  const std::string folder = dir.File("cache"), raster = WriteRaster(dir, Hills(700, 700));
  fs::create_directories(folder + "/sub-0123456789abcdef.statistics");
  const std::string big(1 << 20, 'x');
  const std::string mine = "TRSTATS1" + big;
  const std::vector<std::pair<std::string, std::string>> foreign = {
      {"notes.txt", big},
      {"a.tif-0123456789abcdef.statistics", big},  // the name alone
      {"a.tif-0123456789abcdef.statistics.partial", big},
      {"a.tif-0123456789abcdeg.statistics", mine},  // the first bytes alone
      {"0123456789abcdef.statistics", mine},
      {"a.tif-0123456789abcdef.statistics.old", mine},
  };
  for (const auto& [name, content] : foreign) {
    std::ofstream(fs::path(folder) / name, std::ios::binary) << content;
    UsedAgo((fs::path(folder) / name).string(), std::chrono::hours(1000));
  }
  fs::create_symlink(dir.File("cache/notes.txt"), folder + "/b.tif-0123456789abcdef.statistics");
  // Files of terrace that are no longer used.
  const std::vector<std::string> old = {"/c.tif-0123456789abcdef.statistics",
                                        "/c.tif-1123456789abcdef.statistics.partial"};
  for (const std::string& name : old) {
    std::ofstream(folder + name, std::ios::binary) << mine;
    UsedAgo(folder + name, std::chrono::hours(10));
  }
  const RasterCache cache{std::make_shared<CacheFolder>(folder, (1 << 20) + 4000), nullptr};
  const auto source = OpenIn(raster, cache);
  EXPECT_NE(source->averages(), nullptr) << "what others wrote takes nothing of the bound";
  for (const std::string& name : old) EXPECT_FALSE(fs::exists(folder + name)) << name;
  for (const auto& [name, content] : foreign) EXPECT_TRUE(ContentOf(folder + "/" + name) == content) << name;
  EXPECT_TRUE(fs::is_symlink(folder + "/b.tif-0123456789abcdef.statistics"));
  EXPECT_TRUE(fs::is_directory(folder + "/sub-0123456789abcdef.statistics"));
}

TEST(CacheFolder, FilesInUseStayAndWhatFindsNoRoomIsKeptInMemory) {
  const TempDir dir;
  const std::string folder = dir.File("cache"), first = WriteRaster(dir, Hills(700, 700), "first.tif"),
                    second = WriteRaster(dir, Hills(800, 700), "second.tif");
  OpenIn(first, CacheIn(folder));
  const std::uint64_t bound = fs::file_size(StatisticsPath(folder, first)) * 3 / 2;
  UsedAgo(StatisticsPath(folder, first), std::chrono::hours(1000));
  const RasterCache cache{std::make_shared<CacheFolder>(folder, bound), std::make_shared<AveragesBudget>()};
  const std::size_t budget = cache.memory->left();
  {
    const auto used = OpenIn(first, cache);
    const auto other = OpenIn(second, cache);
    EXPECT_NE(used->averages(), nullptr);
    EXPECT_EQ(other->averages(), nullptr);
    ASSERT_NE(other->memory_averages(), nullptr);
    EXPECT_EQ(other->memory_averages()->min_factor(), 2);
    EXPECT_EQ(cache.memory->left(), budget - other->memory_averages()->bytes());
    EXPECT_NE(cache.folder->problem().find("cache_dir_bytes"), std::string::npos) << cache.folder->problem();
    ExpectAveragesOf(first, *used);
    ExpectAveragesOf(second, *other);
    EXPECT_LE(BytesIn(folder), bound);
  }
  EXPECT_EQ(cache.folder->problem(), "") << "nobody lacks anything any more";
  EXPECT_EQ(cache.memory->left(), budget);
  EXPECT_NE(OpenIn(second, cache)->averages(), nullptr) << "the first one goes";
  EXPECT_LE(BytesIn(folder), bound);
}

TEST(CacheFolder, IsSharedByProcesses) {
  const TempDir dir;
  const std::string folder = dir.File("cache");
  std::vector<std::string> rasters;
  for (int i = 0; i < 8; ++i) rasters.push_back(WriteRaster(dir, Hills(700, 700), std::to_string(i) + ".tif"));
  OpenIn(rasters[0], CacheIn(folder));
  const std::uint64_t bound = BytesIn(folder) * 5;
  std::vector<pid_t> children;
  for (int child = 0; child < 2; ++child) {
    children.push_back(::fork());
    if (children.back() != 0) continue;
    const RasterCache cache{std::make_shared<CacheFolder>(folder, bound), std::make_shared<AveragesBudget>()};
    bool is_well = true;
    for (int turn = 0; turn < 2; ++turn) {
      for (std::size_t i = 0; i < rasters.size(); ++i) {
        const std::string& path = rasters[child == 0 ? i : rasters.size() - 1 - i];
        const auto source = OpenIn(path, cache);
        const auto dataset = OpenRaster(path);
        const auto read = source->ReadAverages(4, {0, 0, 175, 175}, {});
        is_well =
            is_well && read && *read == ReadAverages(**dataset, source->layout(), 4, {0, 0, 175, 175}, {}).value();
      }
    }
    ::_exit(is_well ? 0 : 1);
  }
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }
  EXPECT_LE(BytesIn(folder), bound);
  for (const auto& entry : fs::directory_iterator(folder)) EXPECT_NE(entry.path().extension(), ".partial");
}

TEST(CacheFolder, AFileInItsPlaceIsToldOnceAndAveragesAreInMemory) {
  const TempDir dir;
  std::ofstream(dir.File("file")) << "x";
  const std::string a = WriteRaster(dir, Hills(700, 700), "a.tif"), b = WriteRaster(dir, Hills(600, 700), "b.tif");
  const RasterCache cache{std::make_shared<CacheFolder>(dir.File("file")), std::make_shared<AveragesBudget>()};
  const LogText log;
  const auto first = OpenIn(a, cache), second = OpenIn(b, cache);
  EXPECT_EQ(log.LinesWith("cache_dir"), 1) << log.text();
  EXPECT_EQ(cache.folder->problem(), "cannot be written: Not a directory");
  ASSERT_TRUE(first->memory_averages() != nullptr && second->memory_averages() != nullptr);
  ExpectAveragesOf(a, *first);
  ExpectAveragesOf(b, *second);
  fs::remove(dir.File("file"));
  const auto again = OpenIn(a, cache);
  EXPECT_NE(again->averages(), nullptr);
  EXPECT_NE(cache.folder->problem(), "") << "the other two go without";
}

// Root may write everywhere, so the test changes the user of all threads of the process to nobody.
class AsNobody {
 public:
  AsNobody() {
    if (is_root_) {
      EXPECT_EQ(::seteuid(65534), 0);
    }
  }
  ~AsNobody() {
    if (is_root_) {
      EXPECT_EQ(::seteuid(0), 0);
    }
  }
  AsNobody(const AsNobody&) = delete;
  AsNobody& operator=(const AsNobody&) = delete;

 private:
  const bool is_root_ = ::geteuid() == 0;
};

TEST(CacheFolder, AFolderThatMayNotBeWrittenToIsReadAllTheSame) {
  const TempDir dir;
  const std::string folder = dir.File("cache"), known = WriteRaster(dir, Hills(700, 700), "known.tif"),
                    other = WriteRaster(dir, Hills(600, 700), "new.tif");
  OpenIn(known, CacheIn(folder));
  constexpr fs::perms kWrite = fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write;
  fs::permissions(folder, fs::perms::all & ~kWrite);
  fs::permissions(dir.path(), fs::perms::all);
  std::optional<AsNobody> nobody(std::in_place);
  const RasterCache cache{std::make_shared<CacheFolder>(folder), std::make_shared<AveragesBudget>()};
  EXPECT_TRUE(OpenIn(known, cache)->preparation().from_cache);
  EXPECT_EQ(cache.folder->problem(), "");
  const auto source = OpenIn(other, cache);
  EXPECT_EQ(cache.folder->problem(), "cannot be written: Permission denied");
  EXPECT_NE(source->memory_averages(), nullptr);
  nobody.reset();
  fs::permissions(folder, fs::perms::owner_all);
}

// A limit on the size of files simulates a disk that fills up in the middle of a file.
void ExpectFullDiskCostsNoAverage(const std::string& path, const std::string& folder) {
  const pid_t child = ::fork();
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{400'000, 400'000};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const RasterCache cache{std::make_shared<CacheFolder>(folder), std::make_shared<AveragesBudget>()};
    const auto source = OpenIn(path, cache);
    EXPECT_EQ(cache.folder->problem(), "cannot be written: File too large");
    EXPECT_NE(source->memory_averages(), nullptr);
    ExpectAveragesOf(path, *source);
    ::_exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_TRUE(fs::is_empty(folder)) << "what is not whole takes no room";
}

TEST(CacheFolder, AFullDiskInMidFileCostsNoAverage) {
  const TempDir dir;
  ExpectFullDiskCostsNoAverage(WriteRaster(dir, Hills(2100, 1100)), dir.File("cache"));
}

// The abandoned file has the averages of the chunks that the run has read.
TEST(CacheFolder, AFullDiskAfterAnInterruptedRunCostsNoAverage) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills(2100, 1100)), folder = dir.File("cache");
  const pid_t child = ::fork();
  if (child == 0) {
    (void)RasterSource::Open(path, {}, CacheIn(folder), [](double done) {
      if (done > .4) ::raise(SIGKILL);
    });
    ::_exit(0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  ASSERT_GT(BytesIn(folder), 0U);
  ExpectFullDiskCostsNoAverage(path, folder);
}

TEST(CacheFolder, WhatVanishesIsReadFromTheSourceUntilItIsOpenedAnew) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills(900, 700)), folder = dir.File("cache");
  const RasterCache cache{std::make_shared<CacheFolder>(folder), std::make_shared<AveragesBudget>()};
  auto source = OpenIn(path, cache);
  EXPECT_FALSE(source->has_lost_cache());
  fs::remove_all(folder);
  std::ofstream(folder) << "x";
  const LogText log;
  ExpectAveragesOf(path, *source);
  EXPECT_TRUE(source->has_lost_cache());
  EXPECT_NE(cache.folder->problem(), "");
  auto anew = OpenIn(path, cache);
  source.reset();
  EXPECT_EQ(log.LinesWith("cache_dir"), 1) << log.text();
  ASSERT_NE(anew->memory_averages(), nullptr);
  ExpectAveragesOf(path, *anew);
  EXPECT_FALSE(anew->has_lost_cache());
  EXPECT_EQ(cache.folder->problem(), "cannot be written: Not a directory");
}

TEST(CacheFolder, FilesThatDoNotFitAreMadeAnewAndSaidOnce) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills(700, 700)), folder = dir.File("cache");
  OpenIn(path, CacheIn(folder));
  const std::string file = StatisticsPath(folder, path), good = ContentOf(file);
  const auto with_header = [&](std::size_t at, char value) {
    std::string content = good;
    content[at] = value;
    const std::uint64_t sum = XXH3_64bits(content.data(), 36);
    std::memcpy(content.data() + 36, &sum, sizeof sum);
    return content;
  };
  const std::vector<std::pair<std::string, std::string>> bad = {
      {"torn", good.substr(0, good.size() / 2)},
      {"empty", ""},
      {"foreign", std::string(5000, 'x')},
      {"of an older version", with_header(8, 3)},
      {"of a newer version", with_header(8, 10)},
      {"of other averages", with_header(12, 64)},
      {"of another raster", with_header(16, static_cast<char>(good[16] ^ 1))},
  };
  for (const auto& [what, content] : bad) {
    SCOPED_TRACE(what);
    std::ofstream(file, std::ios::binary) << content;
    const LogText log;
    const auto source = OpenIn(path, CacheIn(folder));
    EXPECT_FALSE(source->preparation().from_cache);
    EXPECT_EQ(log.LinesWith("prepared anew"), 1) << log.text();
    ExpectAveragesOf(path, *source);
    EXPECT_TRUE(OpenIn(path, CacheIn(folder))->preparation().from_cache);
    EXPECT_EQ(log.LinesWith("prepared anew"), 1) << log.text();
  }
}

TEST(CacheFolder, OneRasterWithTwoNamesHasOneFile) {
  const TempDir dir;
  fs::create_directory(dir.File("real"));
  const std::string path = WriteRaster(dir, Hills(700, 700), "real/dem.tif"), folder = dir.File("cache");
  fs::create_directory_symlink(dir.File("real"), dir.File("link"));
  const auto first = OpenIn(path, CacheIn(folder));
  const auto second = OpenIn(dir.File("link/dem.tif"), CacheIn(folder));
  EXPECT_TRUE(second->preparation().from_cache);
  ExpectAveragesOf(path, *first);
  EXPECT_FALSE(first->has_lost_cache());
}

TEST(CacheFolder, UnitsOfTwoDatasetsHaveFilesOfTheirOwn) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills(700, 700)), folder = dir.File("cache");
  const auto source = OpenIn(path, CacheIn(folder));
  RasterLayout feet = source->layout();
  feet.rules.metres_per_unit = 0.3048;
  const auto dataset = OpenRaster(path);
  ASSERT_TRUE(dataset);
  const auto prepared = PrepareRaster(**dataset, feet, path, source->files(), {CacheIn(folder)});
  ASSERT_TRUE(prepared);
  EXPECT_FALSE(prepared->preparation.from_cache);
  EXPECT_TRUE(OpenIn(path, CacheIn(folder))->preparation().from_cache);
  ExpectAveragesOf(path, *source);
  EXPECT_FALSE(source->has_lost_cache());

  // Whoever looked before this file was finished does not make it again.
  const auto writer =
      StatisticsCacheWriter::Open(std::make_shared<CacheFolder>(folder), prepared->cache_file, prepared->key, {});
  ASSERT_TRUE(writer);
  EXPECT_FALSE(writer->has_value());
}

TEST(CacheFolder, AveragesOfAnotherRasterAreNotReadFromTheSameInode) {
  const TempDir dir;
  RasterSpec deeper = Hills(700, 700);
  deeper.value = [value = deeper.value](int c, int r) { return value(c, r) - 500; };
  const std::string path = WriteRaster(dir, Hills(700, 700)), other = WriteRaster(dir, deeper, "other.tif"),
                    folder = dir.File("cache");
  OpenIn(other, CacheIn(folder));
  const auto source = OpenIn(path, CacheIn(folder));
  std::ofstream(StatisticsPath(folder, path), std::ios::binary) << ContentOf(StatisticsPath(folder, other));
  ExpectAveragesOf(path, *source);
  EXPECT_TRUE(source->has_lost_cache());
}

TEST(KeptFactors, NoLevelReadsManySamplesForANode) {
  RasterLayout layout;
  const auto factors = [&](int width, int height, std::vector<int> overviews) {
    layout.width = layout.columns = width;
    layout.height = height;
    layout.overview_factors = std::move(overviews);
    return KeptFactors(layout);
  };
  EXPECT_EQ(factors(512, 512, {}), 0U) << "a tile has half as many nodes a side";
  EXPECT_EQ(factors(600, 600, {}), 2U + 4 + 8 + 16 + 32);
  EXPECT_EQ(factors(5000, 5000, {}), 2U + 4 + 8 + 16 + 32);
  EXPECT_EQ(factors(5000, 5000, {2, 4, 8, 16}), 0U);
  EXPECT_FALSE(KeepsCoarse(layout));
  EXPECT_EQ(factors(5000, 5000, {8, 16, 32}), 2U + 4) << "the overviews have the others";
  EXPECT_EQ(factors(5000, 5000, {2}), 4U + 8 + 16 + 32);
  EXPECT_TRUE(KeepsCoarse(layout));
  EXPECT_EQ(factors(900, 900, {2}), 0U) << "450 x 450 are read quickly";
}

TEST(KeptFactors, WhatOverviewsLackIsKeptBitForBit) {
  for (const std::vector<int>& overviews : {std::vector<int>{8, 16}, {2}}) {
    SCOPED_TRACE(overviews.front());
    const TempDir dir;
    RasterSpec spec = Hills(2301, 1203);
    spec.overviews = overviews;
    const auto value = spec.value;
    // One chunk has only voids. Because of the odd width, samples of the overview cross its edge.
    spec.value = [value](int c, int r) { return c >= 1024 && c < 2048 ? -9999 : value(c, r); };
    const std::string path = WriteRaster(dir, spec);
    const auto in_folder = OpenIn(path, CacheIn(dir.File("cache")));
    ASSERT_NE(in_folder->averages(), nullptr);
    EXPECT_EQ(in_folder->layout().overview_factors, overviews);
    ExpectAveragesOf(path, *in_folder);
    const auto in_memory = OpenIn(path, {nullptr, std::make_shared<AveragesBudget>()});
    ASSERT_NE(in_memory->memory_averages(), nullptr);
    ExpectAveragesOf(path, *in_memory);
  }
}

TEST(MemoryAverages, EachRasterGetsAShareOfWhatIsLeft) {
  RasterLayout layout;
  layout.width = layout.columns = layout.height = 3601;
  const auto budget = std::make_shared<AveragesBudget>(std::size_t{40} << 20);
  const std::size_t all = budget->left();
  std::vector<std::unique_ptr<MemoryAverages>> kept;
  for (int i = 0; i < 70; ++i) {
    kept.push_back(MemoryAverages::Make(layout, budget));
    ASSERT_NE(kept.back(), nullptr) << i;
    EXPECT_GE(kept.back()->min_factor(), i == 0 ? 4 : kept[kept.size() - 2]->min_factor());
  }
  EXPECT_EQ(kept.front()->min_factor(), 4) << "factors 2 to 32 need 17 MiB, an eighth is 5 MiB";
  EXPECT_GT(kept.back()->min_factor(), 4);
  EXPECT_GT(budget->left(), 0U);
  kept.clear();
  EXPECT_EQ(budget->left(), all);
  layout.overview_factors = {2, 4, 8, 16, 32};
  EXPECT_EQ(MemoryAverages::Make(layout, budget), nullptr);
}

}  // namespace
}  // namespace terrace::dem

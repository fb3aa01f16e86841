// Thousands of sources: which of them a tile examines, what stays in memory, and how they are opened.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <utility>

#include "engine/bound/grid_statistics.h"
#include "engine/mosaic/grid_voids.h"
#include "engine/mosaic/raster_grid.h"
#include "engine/sources/raster_source.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/source_fixture.h"

namespace terrace::dem {
namespace {

// One raster grid of columns x rows rasters of side x side samples, each at its own height.
RasterGrid MakeGrid(const TempDir& dir, const std::array<double, 6>& first, const std::string& crs, int columns,
                    int rows, int side) {
  std::vector<std::shared_ptr<const RasterSource>> rasters;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      RasterSpec spec;
      spec.width = spec.height = side;
      spec.crs = crs;
      spec.geo_transform = first;
      spec.geo_transform[0] += x * side * first[1];
      spec.geo_transform[3] += y * side * first[5];
      spec.value = [x, y](int column, int row) { return 100.0 * y + x + 0.01 * (column + row); };
      rasters.push_back(OpenRasterOrFail(WriteRaster(dir, spec, std::to_string(y) + "-" + std::to_string(x) + ".tif")));
    }
  }
  std::vector<GridPlan> plans = PlanGrids(rasters);
  EXPECT_EQ(plans.size(), 1U);
  auto grid = RasterGrid::Make(std::move(plans.front()), {.max_void_gap = 64});
  EXPECT_TRUE(grid.has_value());
  return *std::move(grid);
}

GridReading TraceOf(const RasterGrid& grid, const geo::Lattice& lattice, const geo::TileKey& key) {
  const NodeWindow window{lattice.FirstColumn(key) - 1, lattice.FirstRow(key) - 1, lattice.cells + 3,
                          lattice.cells + 3};
  std::vector<float> heights(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                             SampleRules::kVoid);
  GridReading reading;
  EXPECT_TRUE(grid.FillNodes(lattice, window, HeightDatum::kEllipsoid, {heights}, {}, &reading));
  return reading;
}

// The range of a box from the tables of all members.
BlockRange OfAllMembers(const RasterGrid& grid, double west, double north, double east, double south) {
  BlockRange range;
  for (const GridMember& member : grid.members()) {
    const auto x = static_cast<double>(member.column), y = static_cast<double>(member.row);
    range.Add(member.raster->statistics()->ranges.Query(west - x, north - y, east - x, south - y));
  }
  return range;
}

// Queries a box around every position of a reading. Returns how many members were examined: the maximum of a box, and
// in all.
std::pair<std::size_t, std::size_t> LookAround(const RasterGrid& grid, const GridReading& reading) {
  const GridStatistics statistics(grid, reading);
  std::size_t most = 0;
  for (std::size_t n = 0; n < reading.cells.positions().columns() * reading.cells.positions().rows(); ++n) {
    const Position p =
        reading.cells.positions().At(n % reading.cells.positions().columns(), n / reading.cells.positions().columns());
    if (!std::isfinite(p.x) || !std::isfinite(p.y)) continue;
    const std::size_t before = statistics.members_visited();
    const BlockRange found = statistics.Ranges(p.x - 1, p.y - 1, p.x + 1, p.y + 1);
    most = std::max(most, statistics.members_visited() - before);
    const BlockRange expected = OfAllMembers(grid, p.x - 1, p.y - 1, p.x + 1, p.y + 1);
    EXPECT_EQ(found.min, expected.min) << p.x << ' ' << p.y;
    EXPECT_EQ(found.max, expected.max) << p.x << ' ' << p.y;
  }
  return {most, statistics.members_visited()};
}

// Columns of a raster grid around the Earth start at one meridian, so a tile there has pixels at both ends.
TEST(ManySources, AroundTheEarthATileLooksAtItsOwnSources) {
  const TempDir dir;
  const RasterGrid grid = MakeGrid(dir, {-180, 0.5, 0, 85, 0, -0.5}, "EPSG:4326", 36, 4, 20);
  ASSERT_TRUE(grid.wraps());
  ASSERT_EQ(grid.members().size(), 144U);
  const geo::Lattice lattice{5, 32};
  const std::int64_t columns = 1 << 6;
  for (const std::int64_t x : {std::int64_t{0}, std::int64_t{7}, columns - 1}) {
    const GridReading reading = TraceOf(grid, lattice, {5, x, 27});
    const auto [most, all] = LookAround(grid, reading);
    EXPECT_LE(most, 4U) << "a tile of 5.6 degrees among sources of 10, column " << x;
    EXPECT_GT(all, 0U);
  }
}

// The index finds the sources that a box of a shallow tile meets.
TEST(ManySources, AShallowTileLooksAtTheSourcesOfEachBox) {
  const TempDir dir;
  const RasterGrid grid = MakeGrid(dir, {-180, 0.5, 0, 85, 0, -0.5}, "EPSG:4326", 36, 4, 20);
  const geo::Lattice lattice{0, 32};
  const GridReading reading = TraceOf(grid, lattice, {0, 0, 0});
  const auto [most, all] = LookAround(grid, reading);
  EXPECT_LE(most, 4U);
}

// Nodes outside a projection have no positions, and must not make the tile examine all sources.
TEST(ManySources, AtTheRimOfAProjectionATileLooksAtItsOwnSources) {
  const TempDir dir;
  const RasterGrid grid = MakeGrid(dir, {300'000, 100, 0, 5'000'000, 0, -100}, "EPSG:32632", 12, 12, 20);
  const geo::Lattice lattice{11, 32};
  const auto [west, north] = std::pair(grid.reach().west, grid.reach().north);
  const double tile = 180.0 / (1 << 11);
  const geo::TileKey corner{11, static_cast<std::int64_t>((west + 0.02 + 180) / tile),
                            static_cast<std::int64_t>((north - 0.02 + 90) / tile)};
  GridReading reading = TraceOf(grid, lattice, corner);
  // Positions of nodes far from a raster grid and outside its projection.
  std::vector<Position> nodes(reading.cells.positions().nodes().begin(), reading.cells.positions().nodes().end());
  std::fill_n(nodes.begin(), 40, kNowhere);
  const GridAxes axes = reading.cells.axes();
  const PositionExtent extent = ExtentOf(nodes);
  reading.cells = NodeCells(NodePositions(reading.cells.positions().window(), std::move(nodes), extent), axes);
  const auto [most, all] = LookAround(grid, reading);
  EXPECT_GT(all, 0U);
  EXPECT_LE(most, 8U);
}

// kShift: shift of every other row of rasters to the east.
constexpr int kSide = 40, kAcross = 4, kShift = 13, kStride = kAcross * kSide + kShift;

// kAcross x kAcross rasters of kSide x kSide samples without those in `missing`, adjacent or overlapping by `shared`
// rows and columns.
std::vector<GridMember> MakeMembers(const TempDir& dir, const std::vector<std::uint8_t>& missing, int shared,
                                    const std::vector<std::uint8_t>& voids) {
  std::vector<GridMember> members;
  for (int k = 0; k < kAcross * kAcross; ++k) {
    if (missing[static_cast<std::size_t>(k)] != 0) continue;
    const int left = k % kAcross * (kSide - shared) + k / kAcross % 2 * kShift, top = k / kAcross * (kSide - shared);
    RasterSpec spec{.width = kSide, .height = kSide, .geo_transform = {left * 0.01, 0.01, 0, -top * 0.01, 0, -0.01}};
    spec.nodata = -9999;
    spec.value = [&, left, top](int c, int r) {
      const bool is_void = voids[static_cast<std::size_t>((top + r) * kStride + left + c)] != 0;
      return is_void ? -9999.0 : 100.0 + c + r;
    };
    auto raster = OpenRasterOrFail(WriteRaster(dir, spec, std::to_string(shared) + "-" + std::to_string(k) + ".tif"));
    if (raster) members.push_back({std::move(raster), left, top});
  }
  return members;
}

BoxIndex IndexOfMembers(const std::vector<GridMember>& members) {
  std::vector<BoxIndex::Entry> entries;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const geo::TileRange at = members[i].pixels();
    entries.push_back({{double(at.start_x), double(at.start_y), double(at.end_x + 1), double(at.end_y + 1)}, i});
  }
  return BoxIndex(entries);
}

// Voids of all members that a flood fill from positions without a raster does not reach.
std::vector<std::uint8_t> HolesByFlood(const std::vector<GridMember>& members, const std::vector<std::uint8_t>& voids,
                                       int side) {
  std::vector<std::uint8_t> holes(voids.size());
  std::vector<std::uint8_t> has(voids.size());
  for (const GridMember& member : members) {
    for (std::int64_t y = member.row; y < member.row + kSide; ++y) {
      for (std::int64_t x = member.column; x < member.column + kSide; ++x)
        has[static_cast<std::size_t>(y * side + x)] = 1;
    }
  }
  for (std::size_t i = 0; i < voids.size(); ++i) holes[i] = has[i] != 0 && voids[i] != 0 ? 1 : 0;
  const auto is_outside = [&](int x, int y) {
    return x < 0 || y < 0 || x >= side || y >= side || has[static_cast<std::size_t>(y * side + x)] == 0;
  };
  std::vector<std::pair<int, int>> queue;
  const auto reach = [&](int x, int y) {
    if (is_outside(x, y) || std::exchange(holes[static_cast<std::size_t>(y * side + x)], 0) == 0) return;
    queue.emplace_back(x, y);
  };
  for (int y = -1; y <= side; ++y) {
    for (int x = -1; x <= side; ++x) {
      if (is_outside(x, y)) reach(x - 1, y), reach(x + 1, y), reach(x, y - 1), reach(x, y + 1);
    }
  }
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const auto [x, y] = queue[i];
    reach(x - 1, y), reach(x + 1, y), reach(x, y - 1), reach(x, y + 1);
  }
  return holes;
}

TEST(ManySources, VoidsThatGoOnInANeighbourAreThoseThatAFloodFinds) {
  std::mt19937 random(11);
  for (int round = 0; round < 12; ++round) {
    SCOPED_TRACE(round);
    const TempDir dir;
    const int shared = round % 2;
    std::vector<std::uint8_t> missing(kAcross * kAcross), voids(kStride * kStride);
    for (std::uint8_t& m : missing) m = random() % 6 == 0 ? 1 : 0;
    // Speckles, and boxes across the joints.
    for (std::uint8_t& v : voids) v = random() % 100 < (round < 6 ? 45 : 5) ? 1 : 0;
    for (int box = 0; box < 25; ++box) {
      const int x = static_cast<int>(random() % (kStride - 20)), y = static_cast<int>(random() % (kStride - 20));
      for (int r = y; r < y + 15; ++r) std::fill_n(&voids[static_cast<std::size_t>(r * kStride + x)], random() % 20, 1);
    }
    const std::vector<GridMember> members = MakeMembers(dir, missing, shared, voids);
    const BoxIndex index = IndexOfMembers(members);
    const GridVoids grid(members, index, 0);
    std::vector<float> heights(voids.size());
    for (std::size_t i = 0; i < voids.size(); ++i) heights[i] = voids[i] != 0 ? SampleRules::kVoid : 0;
    const auto found = grid.HolesIn(members, index, 1, {0, 0, kStride, kStride}, kStride, heights);
    const auto expected = HolesByFlood(members, voids, kStride);
    int wrong = 0;
    for (std::size_t i = 0; i < voids.size(); ++i) wrong += found[i] != expected[i];
    EXPECT_EQ(wrong, 0);
  }
}

// The cost of thousands of sparse rasters must not be proportional to the pixels of their rims.
TEST(ManySources, VoidsAreComparedAsOftenAsSomethingChangesAlongTheRims) {
  const TempDir dir;
  std::vector<std::uint8_t> voids(kStride * kStride, 1);
  for (int y = 0; y < kAcross * kSide; y += kSide) {
    for (int x = 0; x < kAcross * kSide; x += kSide) voids[static_cast<std::size_t>((y + 17) * kStride + x + 17)] = 0;
  }
  const auto members = MakeMembers(dir, std::vector<std::uint8_t>(kAcross * kAcross), 0, voids);
  const GridVoids grid(members, IndexOfMembers(members), 0);
  EXPECT_GT(grid.examinations(), 0u);
  EXPECT_LE(grid.examinations(), members.size() * 40) << "160 pixels of a rim, with a neighbour each";
}

RasterSpec Rough(int side) {
  RasterSpec spec;
  spec.width = spec.height = side;
  spec.geo_transform = {7, 1.0 / 3600, 0, 47, 0, -1.0 / 3600};
  spec.value = [](int column, int row) {
    return std::sin(column * 0.37) * 300 + std::cos(row * 0.21) * 200 + column * row % 97;
  };
  return spec;
}

TEST(ManySources, PagedTablesSayWhatKeptOnesDo) {
  const TempDir dir, cache;
  const std::string path = WriteRaster(dir, Rough(1500));
  const auto kept = OpenRasterOrFail(path);
  const auto pages = std::make_shared<StatisticsPages>(0, 1);
  auto opened = RasterSource::Open(path, {}, CacheIn(cache.path().string()), {}, {}, pages);
  ASSERT_TRUE(opened.has_value()) << opened.error().message;
  const RasterSource& paged = **opened;
  EXPECT_EQ(pages->paged.bytes(), 0U) << "nothing was asked for yet";
  std::mt19937 random(3);
  const auto pick = [&random](int count) { return static_cast<double>(random() % static_cast<unsigned>(count)); };
  for (int i = 0; i < 300; ++i) {
    const double west = pick(1500), north = pick(1500), size = pick(i % 2 == 0 ? 40 : 1500);
    const BlockRange a = kept->RangeIn(west, north, west + size, north + size);
    const BlockRange b = paged.RangeIn(west, north, west + size, north + size);
    ASSERT_EQ(a.min, b.min);
    ASSERT_EQ(a.max, b.max);
    ASSERT_EQ(a.has_voids, b.has_voids);
    for (const int factor : {2, 8, 64}) {
      ASSERT_EQ(kept->statistics()->errors.Largest(factor, west, north, west + size, north + size),
                paged.statistics()->errors.Largest(factor, west, north, west + size, north + size));
    }
  }
  EXPECT_GT(pages->paged.bytes(), 0U);
  EXPECT_EQ(kept->ReadAverages(64, {3, 4, 5, 6}, {}).value(), paged.ReadAverages(64, {3, 4, 5, 6}, {}).value());
}

// A shallow tile reads a few averages of each of hundreds of sources; reading their samples would take a minute.
TEST(ManySources, ShallowTilesReadKeptAveragesOfASource) {
  const TempDir dir, cache;
  const std::string path = WriteRaster(dir, Rough(1500)), small = WriteRaster(dir, Rough(500), "small.tif");
  const auto whole = OpenRasterOrFail(path);
  for (const bool is_known : {false, true}) {
    SCOPED_TRACE(is_known);
    const auto kept = RasterSource::Open(path, {}, CacheIn(cache.path().string()));
    ASSERT_TRUE(kept.has_value()) << kept.error().message;
    ASSERT_NE((*kept)->averages(), nullptr);
    for (const int factor : {2, 4, 8, 16, 32, 64}) {
      SCOPED_TRACE(factor);
      const std::uint64_t before = (*kept)->averages()->bytes_read();
      const int blocks = (1500 + factor - 1) / factor;
      EXPECT_EQ((*kept)->ReadAverages(factor, {0, 0, blocks, blocks}, {}).value(),
                whole->ReadAverages(factor, {0, 0, blocks, blocks}, {}).value());
      const std::uint64_t bytes = (*kept)->averages()->bytes_read() - before;
      if (factor > 32) {
        EXPECT_EQ(bytes, 0U);
      } else {
        EXPECT_GE(bytes, std::uint64_t{4} * static_cast<unsigned>(blocks * blocks));
        EXPECT_EQ((*kept)->ReadAverages(factor, {0, 0, blocks, blocks}, {}).value(),
                  whole->ReadAverages(factor, {0, 0, blocks, blocks}, {}).value());
        EXPECT_EQ((*kept)->averages()->bytes_read(), before + bytes) << "chunks stay in memory";
      }
    }
  }
  const auto read_whole = RasterSource::Open(small, {}, CacheIn(cache.path().string()));
  ASSERT_TRUE(read_whole.has_value());
  EXPECT_EQ((*read_whole)->averages(), nullptr);
}

TEST(ManySources, PagedTablesOfALostFileAreMadeAgain) {
  const TempDir dir, cache;
  const std::string path = WriteRaster(dir, Rough(1100));
  const auto pages = std::make_shared<StatisticsPages>(0, 1);
  auto opened = RasterSource::Open(path, {}, CacheIn(cache.path().string()), {}, {}, pages);
  ASSERT_TRUE(opened.has_value());
  const RasterSource& raster = **opened;
  const auto drop = [&] {
    pages->paged.Erase(&raster);
    for (const auto& entry : std::filesystem::directory_iterator(cache.path())) std::filesystem::remove(entry.path());
  };
  const float highest = raster.RangeIn(10, 10, 20, 20).max;
  drop();
  EXPECT_EQ(raster.RangeIn(10, 10, 20, 20).max, highest);
  EXPECT_FALSE(std::filesystem::is_empty(cache.path())) << "and kept again";
  drop();
  std::filesystem::remove(path);
  try {
    raster.RangeIn(10, 10, 20, 20);
    ADD_FAILURE() << "no bound is better than a wrong one";
  } catch (const ThrownError& thrown) {
    EXPECT_EQ(thrown.error().code, ErrorCode::kChanged) << thrown.what();
  }
}

TEST(ManySources, SourcesOfOneProjectionShareItsOperation) {
  const TempDir dir;
  RasterSpec spec;
  spec.crs = "EPSG:32632";
  spec.geo_transform = {500'000, 30, 0, 5'000'000, 0, -30};
  const auto first = OpenRasterOrFail(WriteRaster(dir, spec, "a.tif"));
  spec.geo_transform[0] = 600'000;
  const auto second = OpenRasterOrFail(WriteRaster(dir, spec, "b.tif"));
  ASSERT_NE(first->georeference().projector(), nullptr);
  EXPECT_EQ(first->georeference().projector(), second->georeference().projector());
}

std::vector<DemFile> WriteFolder(const TempDir& dir, int count) {
  std::vector<DemFile> files;
  for (int i = 0; i < count; ++i) {
    RasterSpec spec;
    spec.geo_transform = {i * 1.0, 1.0 / 16, 0, 10, 0, -1.0 / 16};
    spec.value = [i](int, int) { return i; };
    files.push_back({WriteRaster(dir, spec, std::to_string(1000 + i) + ".tif"), 0, true});
  }
  return files;
}

// For any order in which they end.
TEST(ManySources, TheFirstFaultIsToldAndWithAListenerAllInOrder) {
  const TempDir dir;
  std::vector<DemFile> files = WriteFolder(dir, 40);
  for (const std::size_t bad : {11, 12, 30}) {
    std::filesystem::resize_file(files[bad].path, std::filesystem::file_size(files[bad].path) - 300);
  }
  for (int round = 0; round < 5; ++round) {
    const auto failed = ElevationModel::Open(files);
    ASSERT_FALSE(failed.has_value());
    EXPECT_NE(failed.error().message.find("1011.tif"), std::string::npos) << failed.error().message;
  }
  std::vector<std::string> told;
  DemOptions options;
  options.fault = [&told](const Error& error) { told.push_back(error.message); };
  ASSERT_FALSE(ElevationModel::Open(files, options).has_value());
  ASSERT_EQ(told.size(), 3U);
  EXPECT_NE(told[0].find("1011.tif"), std::string::npos);
  EXPECT_NE(told[2].find("1030.tif"), std::string::npos);
}

TEST(ManySources, OpeningTellsItsProgressAndStops) {
  const TempDir dir;
  const std::vector<DemFile> files = WriteFolder(dir, 30);
  DemOptions options;
  std::vector<double> shares;
  options.progress = [&shares](double share) { shares.push_back(share); };
  ASSERT_TRUE(ElevationModel::Open(files, options).has_value());
  EXPECT_TRUE(std::ranges::is_sorted(shares));
  EXPECT_NEAR(shares.back(), 1, 1e-9);
  EXPECT_GE(shares.size(), 30U);
  std::stop_source stop;
  options.stop = stop.get_token();
  options.progress = [&stop](double share) {
    if (share > 0.3) stop.request_stop();
  };
  const auto stopped = ElevationModel::Open(files, options);
  ASSERT_FALSE(stopped.has_value());
  EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
}

TEST(ManySources, TheLogSaysTheSameOfManySourcesAFewTimes) {
  const TempDir dir;
  const auto files = WriteFolder(dir, 30);
  const std::string log = LogOf([&] { EXPECT_TRUE(ElevationModel::Open(files).has_value()); });
  EXPECT_EQ(std::ranges::count(log, '\n'), 6) << log;
  EXPECT_NE(log.find("25 more sources have lines like this one: no vertical datum stated"), std::string::npos) << log;
}

// Files without statistics are opened once more after OpenFromCache, and told then.
TEST(ManySources, TheLogSaysTheSameOfAFileOnce) {
  const TempDir dir;
  DemOptions options;
  options.cache = CacheIn(dir.File("cache"));
  const auto files = WriteFolder(dir, 2);
  EXPECT_TRUE(ElevationModel::Open({files.front()}, options).has_value());
  EXPECT_EQ(LogOf([&] { EXPECT_FALSE(ElevationModel::OpenFromCache(files, options).has_value()); }), "");
  for (const bool only_cached : {false, true}) {
    const std::string log = LogOf([&] {
      EXPECT_TRUE((only_cached ? ElevationModel::OpenFromCache(files, options) : ElevationModel::Open(files, options))
                      .has_value());
    });
    EXPECT_EQ(std::ranges::count(log, '\n'), 2) << log;
  }
}

}  // namespace
}  // namespace terrace::dem

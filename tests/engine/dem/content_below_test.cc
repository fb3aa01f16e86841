// ContentBelow: where it is equal, tiles are. A bake that is brought up to date keeps the others'
// files.
#include "engine/dem/content_below.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr int kSide = 400, kColumns = 4, kRows = 2;  // samples of a raster; rasters
// Each raster is as large as a tile of level 8 and almost lies in one: what crosses a joint crosses an edge of tiles,
// and a tile does not meet the raster beyond.
constexpr int kLevel = 8;
constexpr double kWidth = 180.0 / 256, kStep = kWidth / kSide;
constexpr double kWest = 8 * kWidth - 2 * kStep, kNorth = 68 * kWidth + 2 * kStep;

// Rasters that adjoin, with hills, voids inside, at rims and across joints, over one coarse raster.
class Landscape {
 public:
  using IsVoid = std::function<bool(int, int)>;  // of a column and a row of all rasters together

  explicit Landscape(const DemOptions& options, IsVoid is_void = ManyVoids)
      : options_(options), is_void_(std::move(is_void)) {
    for (int i = 0; i < kColumns * kRows; ++i) Write(i);
    RasterSpec base;  // where the large hole is, nothing lies below: its surface shows
    base.width = is_void_(2 * kSide, kSide) ? 20 : 80;
    base.height = 60;
    base.geo_transform = {kWest - 2, .1, 0, kNorth + 2, 0, -.1};
    base.value = [](int c, int r) { return 50 + (c * 7 + r * 3) % 20; };
    WriteRaster(dir_, base, "base.tif");
  }

  std::unique_ptr<ElevationModel> Open() const {
    std::vector<DemFile> files;
    for (int i = 0; i < kColumns * kRows; ++i) files.push_back({dir_.File(NameOf(i))});
    files.push_back({dir_.File("base.tif"), 1});
    return OpenOrFail(files, options_);
  }

  // Changes one sample of a raster; a void if `value` is kNoData.
  void Change(int raster, int column, int row, double value) {
    Set(raster, column, row, value);
    Write(raster);
  }
  // Before Write.
  void Set(int raster, int column, int row, double value) { changes_[raster][{column, row}] = value; }

  static std::string NameOf(int raster) { return "r" + std::to_string(raster) + ".tif"; }

  void Write(int raster) {
    RasterSpec spec;
    spec.width = spec.height = kSide;
    spec.type = "Int16";
    spec.nodata = kNoData;
    const int left = raster % kColumns * kSide, top = raster / kColumns * kSide;
    spec.geo_transform = {kWest + left * kStep, kStep, 0, kNorth - top * kStep, 0, -kStep};
    spec.value = [&, left, top](int c, int r) {
      if (const auto change = changes_[raster].find({c, r}); change != changes_[raster].end()) return change->second;
      const int x = left + c, y = top + r;
      return is_void_(x, y) ? kNoData
                            : 600 + std::floor(300 * std::sin(x / 41.0) * std::cos(y / 29.0)) + (x * 31 + y * 17) % 11;
    };
    WriteRaster(dir_, spec, NameOf(raster));
  }

  static constexpr double kNoData = -9999;

  // Across the joint of two rasters, of four, inside one, and at the outer rim.
  static bool ManyVoids(int x, int y) {
    const auto is_near = [&](int to_x, int to_y, int size) { return std::hypot(x - to_x, y - to_y) < size; };
    return is_near(kSide, 150, 70) || is_near(3 * kSide, kSide, 40) || is_near(700, 600, 90) || is_near(0, 500, 60) ||
           is_near(1250, 100, 3);
  }

  // Over all four columns of rasters.
  static bool LargeHole(int x, int y) { return std::hypot((x - 800) / 450.0, (y - 400) / 330.0) < 1; }

 private:
  const TempDir dir_;
  const DemOptions options_;
  const IsVoid is_void_;
  std::map<int, std::map<std::pair<int, int>, double>> changes_;
};

// What tiles below a tile are made of.
struct Below {
  ContentHash hash;
  std::vector<float> heights;
  std::vector<double> bounds;
};

// Of the rasters, and one around.
std::vector<geo::TileKey> Tops() {
  const auto first_x = std::lround((kWest + 180) / kWidth), last_y = std::lround((kNorth + 90) / kWidth);
  std::vector<geo::TileKey> tops;
  for (std::int64_t y = last_y - kRows - 1; y <= last_y; ++y) {
    for (std::int64_t x = first_x - 1; x <= first_x + kColumns; ++x) tops.push_back({kLevel, x, y});
  }
  return tops;
}

Below ReadBelow(const ElevationModel& model, const geo::TileKey& top) {
  const int deepest = top.level + 2;
  Below below{ContentBelow(model, top, deepest), {}, {}};
  for (int level = top.level; level <= deepest; level += 2) {
    const int down = level - top.level;
    const std::int64_t last = (std::int64_t{1} << down) - 1;
    for (const auto& [dx, dy] : {std::pair{std::int64_t{0}, std::int64_t{0}}, {last, last}, {last, std::int64_t{0}}}) {
      const geo::TileKey key{level, (top.x << down) + dx, (top.y << down) + dy};
      const auto tile = model.Read(key);
      EXPECT_TRUE(tile.has_value());
      if (!tile) continue;
      below.heights.insert(below.heights.end(), tile->heights.begin(), tile->heights.end());
      below.bounds.push_back(tile->source_error_m);
      for (int nx = -1; nx <= 1; ++nx) {
        for (int ny = -1; ny <= 1; ++ny) {
          const HeightRange range = model.RangeBound(geo::Neighbour(key, nx, ny));
          below.bounds.push_back(range.min);
          below.bounds.push_back(range.max);
        }
      }
    }
  }
  return below;
}

std::vector<Below> ReadAll(const Landscape& landscape) {
  std::vector<Below> all;
  if (const auto source = landscape.Open()) {
    for (const geo::TileKey& top : Tops()) all.push_back(ReadBelow(*source, top));
  }
  return all;
}

// Returns the numbers of subtrees with equal and with different hashes.
std::pair<int, int> ExpectSameWhereHashesAre(const std::vector<Below>& before, const std::vector<Below>& after) {
  int same = 0, others = 0;
  EXPECT_EQ(before.size(), after.size());
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    if (!(before[i].hash == after[i].hash)) {
      ++others;
      continue;
    }
    ++same;
    EXPECT_EQ(before[i].heights, after[i].heights) << i;
    EXPECT_EQ(before[i].bounds, after[i].bounds) << i;
  }
  return {same, others};
}

DemOptions Options(double feather, HoleFill voids) {
  DemOptions options;
  options.floor = 0;
  options.feather = feather;
  options.holes = voids;
  return options;
}

TEST(ContentBelow, EqualHashesMeanEqualTiles) {
  std::mt19937 dice(11);
  const auto random = [&](int below) { return static_cast<int>(dice() % static_cast<unsigned>(below)); };
  for (const DemOptions& options :
       {Options(0, HoleFill::kSmooth), Options(4000, HoleFill::kSmooth), Options(0, HoleFill::kFloor)}) {
    Landscape landscape(options);
    std::vector<Below> before = ReadAll(landscape);
    int same = 0, others = 0;
    constexpr int kChanges = 8;
    for (int i = 0; i < kChanges; ++i) {
      // Close to the joints, where what one raster holds reaches into its neighbour.
      const auto near_joint = [&] { return i % 4 == 0 ? random(kSide) : (random(20) + kSide - 10) % kSide; };
      landscape.Change(random(kColumns * kRows), near_joint(), near_joint(),
                       i % 3 == 0 ? Landscape::kNoData : 400 + random(i % 3 == 1 ? 400 : 5000));
      std::vector<Below> after = ReadAll(landscape);
      const auto [kept, changed] = ExpectSameWhereHashesAre(before, after);
      same += kept;
      others += changed;
      before = std::move(after);
    }
    EXPECT_GT(same, 0) << "every change changes everything";
    EXPECT_GT(others, 0);
  }
}

// The surface in a hole depends on heights at its other side, also if the range of heights around it stays the same.
TEST(ContentBelow, TheOtherSideOfAHoleCounts) {
  Landscape landscape(Options(0, HoleFill::kSmooth), Landscape::LargeHole);
  const std::vector<Below> before = ReadAll(landscape);
  for (int row = kSide - 100; row < kSide; ++row) {
    for (int column = 320; column < 370; ++column) {
      if (!Landscape::LargeHole(column, row)) landscape.Set(0, column, row, 850);
    }
  }
  landscape.Write(0);
  const auto [same, others] = ExpectSameWhereHashesAre(before, ReadAll(landscape));
  EXPECT_GT(same, 0);
  EXPECT_GT(others, 0);
}

// A channel from the hole to the rim in one raster: the void shows the floor in the others, too.
TEST(ContentBelow, AHoleThatOpensFarAwayCounts) {
  DemOptions options = Options(0, HoleFill::kSmooth);
  options.floor = 600;  // within the range of heights
  Landscape landscape(options, Landscape::LargeHole);
  const std::vector<Below> before = ReadAll(landscape);
  for (int row = 0; row < kSide; ++row) landscape.Set(3, 40, row, Landscape::kNoData);
  landscape.Write(3);
  const int others = ExpectSameWhereHashesAre(before, ReadAll(landscape)).second;
  EXPECT_GT(others, 0);
}

TEST(ContentBelow, OptionsAndLowestLevelCount) {
  Landscape landscape(Options(0, HoleFill::kSmooth));
  const auto source = landscape.Open();
  ASSERT_TRUE(source);
  const geo::TileKey top = Tops()[5];
  const ContentHash hash = ContentBelow(*source, top, 10);
  EXPECT_EQ(hash, ContentBelow(*source, top, 10));
  EXPECT_NE(hash, ContentBelow(*source, top, 9));
  for (const auto& change : std::vector<std::function<void(DemOptions&)>>{
           [](DemOptions& o) { o.floor = 1; }, [](DemOptions& o) { o.feather = 100; },
           [](DemOptions& o) { o.holes = HoleFill::kFloor; }, [](DemOptions& o) { o.max_void_gap = 5; },
           [](DemOptions& o) { o.source.vertical = "egm96"; }}) {
    DemOptions options = Options(0, HoleFill::kSmooth);
    change(options);
    const auto other = Landscape(options).Open();
    ASSERT_TRUE(other);
    EXPECT_NE(ContentBelow(*other, top, 10), hash);
  }
}

}  // namespace
}  // namespace terrace::dem

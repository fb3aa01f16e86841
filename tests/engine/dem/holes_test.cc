// Large voids: holes are filled with a smooth surface, collars show the floor.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem::holes {
namespace {

constexpr double kPixel = 1.0 / 3600, kNoData = -9999, kFloor = -500;

using VoidAt = std::function<bool(int, int)>;
using HeightAt = std::function<double(int, int)>;

// 7 and 4 metres from one sample to the next.
double Plane(double column, double row) { return 300 + 7 * column + 4 * row; }

double Rough(int column, int row) {
  std::uint32_t hash = static_cast<std::uint32_t>(column) * 73856093u ^ static_cast<std::uint32_t>(row) * 19349663u;
  hash = (hash ^ hash >> 13) * 0x5bd1e995u;
  return 800 + 300 * std::sin(column * 0.05) * std::cos(row * 0.07) + (hash >> 16 & 1023) * 0.03;
}

RasterSpec Raster(int width, int height, const HeightAt& height_at, const VoidAt& is_void) {
  RasterSpec spec{
      .width = width, .height = height, .geo_transform = {10, kPixel, 0, 20, 0, -kPixel}, .nodata = kNoData};
  spec.value = [=](int c, int r) { return is_void(c, r) ? kNoData : height_at(c, r); };
  return spec;
}

VoidAt Box(int column, int row, int columns, int rows) {
  return [=](int c, int r) { return c >= column && c < column + columns && r >= row && r < row + rows; };
}

// The position of a tile's node in samples.
struct Place {
  double x, y;

  bool IsIn(double west, double north, double east, double south) const {
    return x > west && x < east && y > north && y < south;
  }
};
Place PlaceOf(const TileHeights& tile, const geo::TileKey& key, int i, int j) {
  const double longitude = tile.lattice.Longitude(tile.lattice.FirstColumn(key) + i);
  const double latitude = tile.lattice.Latitude(tile.lattice.FirstRow(key) + j);
  return {(longitude - 10) / kPixel - 0.5, (20 - latitude) / kPixel - 0.5};
}
GeoPosition DegreesOf(double x, double y) { return {10 + (x + 0.5) * kPixel, 20 - (y + 0.5) * kPixel}; }

// The deepest level whose tiles have some hundred samples a side.
constexpr int kLevel = 11;

// Calls visit(tile, i, j, place) for all nodes of a level's tiles.
template <typename Visit>
void ForNodes(const ElevationModel& model, int level, const Visit& visit) {
  for (const geo::TileKey& key : SomeTiles(model, level, 1 << 20)) {
    const auto tile = model.Read(key);
    ASSERT_TRUE(tile) << tile.error().message;
    for (int j = 0; j <= tile->lattice.cells; ++j) {
      for (int i = 0; i <= tile->lattice.cells; ++i) visit(*tile, i, j, PlaceOf(*tile, key, i, j));
    }
  }
}

TEST(Holes, OfAPlaneGoOnWithThePlane) {
  const TempDir dir;
  constexpr int kMargin = 20, kSide = 300 + 2 * kMargin;
  const auto source =
      OpenOrFail(WriteRaster(dir, Raster(kSide, kSide, Plane, Box(kMargin, kMargin, 300, 300))), {.floor = kFloor});
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->info().sources[0].enclosed_samples, 300u * 300u);
  const double lowest = Plane(kMargin - 1, kMargin - 1), highest = Plane(kMargin + 300, kMargin + 300);
  for (const int level : {kLevel, kLevel + 1, kLevel - 2}) {
    SCOPED_TRACE(level);
    const double step = source->LatticeOf(level).StepDegrees() / kPixel;  // samples
    double farthest = 0, steep_x = 0, steep_y = 0;
    int inside = 0;
    ForNodes(*source, level, [&](const TileHeights& tile, int i, int j, const Place& at) {
      const double height = tile.At(i, j);
      if (at.IsIn(kMargin - 1, kMargin - 1, kMargin + 300, kMargin + 300)) {
        ++inside;
        EXPECT_GE(height, lowest);
        EXPECT_LE(height, highest);
      }
      if (!at.IsIn(4, 4 + step, kSide - 5 - step, kSide - 5)) return;  // averages at the rim cover fewer samples
      if (level >= kLevel) farthest = std::max(farthest, std::abs(height - Plane(at.x, at.y)));
      steep_x = std::max(steep_x, std::abs(tile.At(i + 1, j) - height));
      steep_y = std::max(steep_y, std::abs(tile.At(i, j + 1) - height));
    });
    EXPECT_GT(inside, 1000);
    EXPECT_LT(farthest, 0.002);
    if (level < kLevel) continue;
    EXPECT_LT(steep_x, 7 * step + 0.003);
    EXPECT_LT(steep_y, 4 * step + 0.003);
  }
}

// Harmonic heights have their extremes at the edge.
TEST(Holes, StayBetweenTheHeightsBesideThem) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Raster(300, 280, Rough, Box(90, 80, 110, 100))), {.floor = kFloor});
  ASSERT_NE(source, nullptr);
  double lowest = 1e9, highest = -1e9;
  for (int row = 79; row <= 180; ++row) {
    for (int column = 89; column <= 200; ++column) {
      if (Box(90, 80, 110, 100)(column, row)) continue;
      lowest = std::min(lowest, Rough(column, row));
      highest = std::max(highest, Rough(column, row));
    }
  }
  int inside = 0;
  ForNodes(*source, kLevel, [&](const TileHeights& tile, int i, int j, const Place& at) {
    if (!at.IsIn(89, 79, 200, 180)) return;
    ++inside;
    EXPECT_GE(tile.At(i, j), lowest - 0.002);
    EXPECT_LE(tile.At(i, j), highest + 0.002);
  });
  EXPECT_GT(inside, 1000);
}

TEST(Holes, AreNoneWhereAVoidTouchesTheRim) {
  const TempDir dir;
  for (const int channel : {0, 1}) {  // width in samples, from the void to the raster's edge
    SCOPED_TRACE(channel);
    const VoidAt is_void = [&](int c, int r) {
      return Box(100, 100, 200, 200)(c, r) || (r == 150 && c >= 300 && c < 400 + channel - 1);
    };
    const auto source = OpenOrFail(WriteRaster(dir, Raster(400, 400, Plane, is_void), std::to_string(channel) + ".tif"),
                                   {.floor = kFloor});
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->info().sources[0].enclosed_samples, channel == 0 ? source->info().sources[0].void_samples : 0);
    int inside = 0;
    ForNodes(*source, kLevel, [&](const TileHeights& tile, int i, int j, const Place& at) {
      if (!at.IsIn(170, 170, 230, 230)) return;
      ++inside;
      EXPECT_EQ(tile.At(i, j) == kFloor, channel == 1);
    });
    EXPECT_GT(inside, 1000);
    const GeoPosition middle = DegreesOf(200, 200);
    const auto point = source->ReadPoints({&middle, 1});
    ASSERT_TRUE(point);
    EXPECT_EQ(std::isnan((*point)[0]), channel == 1);
  }
}

TEST(Holes, ShowTheFloorWhereTheOwnerWantsThat) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Raster(400, 400, Plane, Box(100, 100, 200, 200)));
  const auto source = OpenOrFail(path, {.floor = kFloor, .holes = HoleFill::kFloor});
  const auto smooth = OpenOrFail(path, {.floor = kFloor});
  ASSERT_TRUE(source && smooth);
  EXPECT_NE(source->fingerprint(), smooth->fingerprint());
  ForNodes(*source, kLevel, [&](const TileHeights& tile, int i, int j, const Place& at) {
    if (at.IsIn(170, 170, 230, 230)) {
      EXPECT_EQ(tile.At(i, j), kFloor);
    }
  });
  const GeoPosition middle = DegreesOf(200, 200);
  const auto point = source->ReadPoints({&middle, 1});
  ASSERT_TRUE(point);
  EXPECT_TRUE(std::isnan((*point)[0]));
}

bool IsSame(float a, float b) { return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b); }

// Windows at other positions and of other sizes read other parts of the raster, but must give the same heights.
void ExpectNoTileMatters(const ElevationModel& model, int level, const geo::TileKey& key) {
  const auto tile = model.Read(key);
  ASSERT_TRUE(tile);
  const geo::Lattice& lattice = tile->lattice;
  const int half = lattice.cells / 2;
  for (const int shift : {-half - 3, half + 7}) {
    const NodeWindow window{lattice.FirstColumn(key) + shift, lattice.FirstRow(key) + 5, lattice.cells, half};
    const auto nodes = model.ReadNodes(level, window);
    ASSERT_TRUE(nodes);
    for (int j = 0; j < window.rows; ++j) {
      for (int i = 0; i < window.columns; ++i) {
        if (i + shift < 0 || i + shift > lattice.cells) continue;
        ASSERT_TRUE(IsSame((*nodes)[static_cast<std::size_t>(j * window.columns + i)], tile->At(i + shift, j + 5)))
            << geo::ToString(key) << ", node " << i + shift << ", " << j + 5;
      }
    }
  }
  for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 1}}) {
    const geo::TileKey next = geo::Neighbour(key, dx, dy);
    if (!geo::IsValid(next)) continue;
    const auto beside = model.Read(next);
    ASSERT_TRUE(beside);
    for (int k = 0; k <= lattice.cells; ++k) {
      ASSERT_TRUE(IsSame(tile->At(dx ? lattice.cells : k, dy ? lattice.cells : k), beside->At(dx ? 0 : k, dy ? 0 : k)))
          << geo::ToString(key) << ", edge node " << k;
    }
  }
}

TEST(Holes, AreTheSameInEveryTile) {
  const VoidAt ragged = [](int c, int r) {  // a large void, one of half the size, and small ones
    const bool disc = std::hypot(c - 300, r - 240) < 190 + 20 * std::sin(c * 0.3) + 15 * std::cos(r * 0.4);
    return disc || Box(520, 300, 100, 90)(c, r) || (c * 7 + r * 13) % 401 == 0;
  };
  RasterSpec plain = Raster(700, 500, Rough, ragged);
  RasterSpec antimeridian = plain;
  antimeridian.geo_transform[0] = 180 - 300 * kPixel;
  RasterSpec globe = Raster(720, 361, Rough, [](int c, int r) {
    return std::hypot(c < 360 ? c : c - 720, r - 150) < 75 || std::hypot(c - 300, r - 20) < 18;
  });
  globe.geo_transform = {-180.25, 0.5, 0, 90.25, 0, -0.5};
  for (const auto& [name, spec, finest] :
       {std::tuple{"plain", plain, 12}, {"antimeridian", antimeridian, 12}, {"globe", globe, 3}}) {
    SCOPED_TRACE(name);
    const TempDir dir;
    const auto source = OpenOrFail(WriteRaster(dir, spec), {.floor = kFloor});
    ASSERT_NE(source, nullptr);
    // In the statistics of the raster alone, its first and last column cut the hole on the seam of the globe.
    EXPECT_GT(source->info().sources[0].enclosed_samples, finest == 3 ? 900u : 10'000u);
    if (finest == 3) {
      const GeoPosition on_seam{-180, 15};
      const auto height = source->ReadPoints({&on_seam, 1});
      ASSERT_TRUE(height);
      EXPECT_GT((*height)[0], 400);
    }
    for (int level = finest; level >= std::max(finest - 5, 0); level -= 2) {
      for (const geo::TileKey& key : SomeTiles(*source, level, 6)) ExpectNoTileMatters(*source, level, key);
    }
  }
}

// A hole that two rasters share is a hole. If the second raster is missing, it is a collar.
TEST(Holes, GoAcrossRastersOfAGrid) {
  const VoidAt is_void = Box(200, 100, 150, 120);
  for (const int shared : {0, 1}) {
    SCOPED_TRACE(shared);
    const TempDir dir;
    const auto whole = OpenOrFail(WriteRaster(dir, Raster(512, 320, Rough, is_void)), {.floor = kFloor});
    RasterSpec west = Raster(256 + shared, 320, Rough, is_void), east = west;
    east.width = 256;
    east.geo_transform[0] += 256 * kPixel;
    east.value = [is_void](int c, int r) { return is_void(c + 256, r) ? kNoData : Rough(c + 256, r); };
    const std::vector<DemFile> files = {{WriteRaster(dir, west, "west.tif")}, {WriteRaster(dir, east, "east.tif")}};
    const auto both = OpenOrFail(files, {.floor = kFloor});
    const auto alone = OpenOrFail(files[0].path, {.floor = kFloor});
    ASSERT_TRUE(whole && both && alone);
    EXPECT_EQ(alone->info().sources[0].enclosed_samples, 0u);
    for (const geo::TileKey& key : SomeTiles(*whole, kLevel, 100)) {
      const auto a = whole->Read(key), b = both->Read(key), c = alone->Read(key);
      ASSERT_TRUE(a && b && c);
      const HeightRange bound = both->RangeBound(key);
      for (int j = 0; j <= a->lattice.cells; ++j) {
        for (int i = 0; i <= a->lattice.cells; ++i) {
          ASSERT_TRUE(IsSame(a->At(i, j), b->At(i, j))) << geo::ToString(key) << ", node " << i << ", " << j;
          ASSERT_TRUE(b->At(i, j) >= bound.min && b->At(i, j) <= bound.max);
          const Place at = PlaceOf(*a, key, i, j);
          if (at.IsIn(240, 140, 254, 180)) {
            EXPECT_EQ(c->At(i, j), kFloor);
          }
          if (at.IsIn(230, 140, 320, 180)) {
            EXPECT_GT(a->At(i, j), 400);
          }
        }
      }
    }
  }
}

// A coarse source below has priority in a hole over the surface. Narrow voids are filled from the fine source.
// Pieces of a raster, each 100 samples a side, as files of a folder.
std::vector<DemFile> WritePieces(const TempDir& dir, int columns, int rows, const VoidAt& is_void) {
  std::vector<DemFile> files;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      RasterSpec piece = Raster(
          100, 100, [=](int c, int r) { return Rough(c + 100 * x, r + 100 * y); },
          [=](int c, int r) { return is_void(c + 100 * x, r + 100 * y); });
      piece.geo_transform[0] += 100 * x * kPixel;
      piece.geo_transform[3] -= 100 * y * kPixel;
      files.push_back({WriteRaster(dir, piece, fmt::format("{}-{}.tif", y, x)), 0, true});
    }
  }
  return files;
}

// Files of nothing but voids are used where they are part of a hole.
TEST(Holes, GoAcrossFilesWithoutAHeight) {
  struct Case {
    const char* name;
    VoidAt is_void;
    int files_left_out;
    Place first, last;  // in files without a height
  };
  const std::vector<Case> cases = {
      {"one file", Box(80, 80, 140, 140), 0, {105, 105}, {195, 195}},
      {"two files side by side", Box(80, 80, 240, 140), 0, {105, 105}, {295, 195}},
      {"as large as the file", Box(200, 100, 100, 100), 0, {205, 105}, {295, 195}},
      {"to the rim", Box(80, 80, 140, 220), 2, {105, 105}, {195, 295}},
      {"beside the data", Box(300, 200, 100, 100), 1, {305, 205}, {395, 295}},
  };
  for (const Case& a_case : cases) {
    SCOPED_TRACE(a_case.name);
    const TempDir dir;
    const auto whole = OpenOrFail(WriteRaster(dir, Raster(400, 300, Rough, a_case.is_void)), {.floor = kFloor});
    const std::vector<DemFile> files = WritePieces(dir, 4, 3, a_case.is_void);
    const DemOptions options{.floor = kFloor, .cache = CacheIn(dir.File("cache"))};
    const auto pieces = OpenOrFail(files, options);
    const auto from_cache = ElevationModel::OpenFromCache(files, options);
    ASSERT_TRUE(whole && pieces && from_cache);
    EXPECT_EQ(pieces->info().left_out.size(), static_cast<std::size_t>(a_case.files_left_out));
    EXPECT_EQ(pieces->info().sources.size(), static_cast<std::size_t>(12 - a_case.files_left_out));
    EXPECT_EQ(pieces->info().heights.min, whole->info().heights.min);
    EXPECT_EQ(pieces->info().heights.max, whole->info().heights.max);
    const bool is_hole = a_case.files_left_out == 0;
    int in_void = 0;
    for (const geo::TileKey& key : SomeTiles(*pieces, kLevel, 100)) {
      const auto a = whole->Read(key), b = pieces->Read(key), c = (*from_cache)->Read(key);
      ASSERT_TRUE(a && b && c);
      EXPECT_EQ(b->heights, c->heights);
      const HeightRange bound = pieces->RangeBound(key);
      for (int j = 0; j <= a->lattice.cells; ++j) {
        for (int i = 0; i <= a->lattice.cells; ++i) {
          if (is_hole) {
            ASSERT_TRUE(IsSame(a->At(i, j), b->At(i, j))) << geo::ToString(key) << ", node " << i << ", " << j;
          }
          ASSERT_TRUE(b->At(i, j) >= bound.min && b->At(i, j) <= bound.max);
          if (!PlaceOf(*a, key, i, j).IsIn(a_case.first.x, a_case.first.y, a_case.last.x, a_case.last.y)) continue;
          ++in_void;
          ASSERT_EQ(b->At(i, j) == kFloor, !is_hole);
        }
      }
    }
    EXPECT_GT(in_void, 100);
  }
}

// Where holes show the floor, files without a height are not needed.
TEST(Holes, NeedNoFilesWithoutAHeightForTheFloor) {
  const TempDir dir;
  const auto model =
      OpenOrFail(WritePieces(dir, 4, 3, Box(80, 80, 140, 140)), {.floor = kFloor, .holes = HoleFill::kFloor});
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->info().sources.size(), 11u);
}

TEST(Holes, ShowASourceBelow) {
  const TempDir dir;
  const auto one_sample = Box(30, 30, 1, 1), large = Box(100, 100, 200, 200);
  const VoidAt is_void = [&](int c, int r) { return one_sample(c, r) || large(c, r); };
  RasterSpec coarse{.width = 40, .height = 40, .geo_transform = {9.9, 0.01, 0, 20.1, 0, -0.01}};
  coarse.value = [](int, int) { return -3000.0; };
  const std::vector<DemFile> files = {{WriteRaster(dir, Raster(400, 400, Plane, is_void)), 0},
                                      {WriteRaster(dir, coarse, "coarse.tif"), 1}};
  const auto source = OpenOrFail(files);
  ASSERT_NE(source, nullptr);
  const std::vector<GeoPosition> points = {DegreesOf(200, 200), DegreesOf(30, 30), DegreesOf(31, 30)};
  std::vector<std::uint8_t> filled(points.size(), 7);
  const auto heights = source->ReadPoints(points, HeightDatum::kEllipsoid, {}, filled);
  ASSERT_TRUE(heights);
  EXPECT_EQ((*heights)[0], -3000);
  EXPECT_NEAR((*heights)[1], Plane(30, 30), 0.01);
  EXPECT_NEAR((*heights)[2], Plane(31, 30), 0.01);
  EXPECT_EQ(filled, (std::vector<std::uint8_t>{0, 1, 0}));
  ForNodes(*source, kLevel, [&](const TileHeights& tile, int i, int j, const Place& at) {
    if (at.IsIn(170, 170, 230, 230)) {
      EXPECT_EQ(tile.At(i, j), -3000);
    }
    if (at.IsIn(25, 25, 35, 35)) {
      EXPECT_NEAR(tile.At(i, j), Plane(at.x, at.y), 0.01);
    }
  });
}

// A point has the height of the node there in a tile of the source's resolution.
TEST(Holes, HaveTheSameHeightsAtPointsAsInTiles) {
  const TempDir dir;
  const VoidAt is_void = [](int c, int r) {
    return Box(100, 90, 180, 160)(c, r) || Box(40, 40, 1, 1)(c, r) || Box(320, 20, 20, 30)(c, r) || c >= 380;
  };
  const auto source = OpenOrFail(WriteRaster(dir, Raster(400, 300, Rough, is_void)), {.floor = kFloor});
  ASSERT_NE(source, nullptr);
  std::vector<GeoPosition> points;
  std::vector<float> drawn;
  std::vector<std::uint8_t> is_filled;
  for (const geo::TileKey& key : SomeTiles(*source, 12, 100)) {
    const auto tile = source->Read(key);
    ASSERT_TRUE(tile);
    for (int j = 0; j <= tile->lattice.cells; j += 3) {
      for (int i = 0; i <= tile->lattice.cells; i += 3) {
        const Place at = PlaceOf(*tile, key, i, j);
        if (!at.IsIn(0, 0, 378, 299)) continue;
        points.push_back(DegreesOf(at.x, at.y));
        drawn.push_back(tile->At(i, j));
        is_filled.push_back(is_void(static_cast<int>(std::lround(at.x)), static_cast<int>(std::lround(at.y))));
      }
    }
  }
  std::vector<std::uint8_t> filled(points.size());
  const auto heights = source->ReadPoints(points, HeightDatum::kEllipsoid, {}, filled);
  ASSERT_TRUE(heights);
  ASSERT_GT(std::ranges::count(filled, 1), 500);
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_NEAR((*heights)[i], drawn[i], 0.01) << points[i].longitude << ", " << points[i].latitude;
    ASSERT_EQ(filled[i], is_filled[i]) << points[i].longitude << ", " << points[i].latitude;
  }
}

// A peak beside a hole raises its surface, and a hole is large: the bound of a tile inside includes both.
TEST(Holes, AreWithinTheRangeBound) {
  const TempDir dir;
  const HeightAt peaks = [](int c, int r) { return Rough(c, r) + (std::hypot(c - 95, r - 300) < 30 ? 4000 : 0); };
  const auto holes = Box(100, 150, 400, 300), collar = Box(0, 0, 600, 40);
  const VoidAt is_void = [&](int c, int r) { return holes(c, r) || collar(c, r); };
  const std::string path = WriteRaster(dir, Raster(600, 550, peaks, is_void));
  const auto source = OpenOrFail(path, {.floor = kFloor});
  const auto floor_only = OpenOrFail(path, {.floor = kFloor, .holes = HoleFill::kFloor});
  ASSERT_TRUE(source && floor_only);
  int tiles_of_collar = 0;
  for (const int level : {9, 11, 13}) {
    for (const geo::TileKey& key : SomeTiles(*source, level, 60)) {
      const auto tile = source->Read(key);
      ASSERT_TRUE(tile);
      const HeightRange bound = source->RangeBound(key);
      double south = 0;
      for (int j = 0; j <= tile->lattice.cells; ++j) {
        for (int i = 0; i <= tile->lattice.cells; ++i) {
          ASSERT_TRUE(tile->At(i, j) >= bound.min && tile->At(i, j) <= bound.max)
              << geo::ToString(key) << ": " << tile->At(i, j) << " outside " << bound.min << " .. " << bound.max;
          south = std::max(south, PlaceOf(*tile, key, i, j).y);
        }
      }
      if (south > 60) continue;  // no hole is near
      const HeightRange plain = floor_only->RangeBound(key);
      EXPECT_TRUE(bound.min == plain.min && bound.max == plain.max) << geo::ToString(key);
      ++tiles_of_collar;
    }
  }
  EXPECT_GT(tiles_of_collar, 0);
}

// The certified error refers to samples only. Filled nodes are not samples, and a plane fits all samples.
TEST(Holes, OfAPlaneCostNoCertifiedError) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Raster(400, 400, Plane, Box(100, 100, 200, 200))), {.floor = kFloor});
  ASSERT_NE(source, nullptr);
  int tiles = 0;
  for (const geo::TileKey& key : SomeTiles(*source, kLevel + 2, 1000)) {
    const auto tile = source->Read(key);
    ASSERT_TRUE(tile);
    const Place a = PlaceOf(*tile, key, 0, tile->lattice.cells), b = PlaceOf(*tile, key, tile->lattice.cells, 0);
    if (a.x < 4 || a.y < 4 || b.x > 395 || b.y > 395) continue;
    EXPECT_LT(tile->source_error_m, 1) << geo::ToString(key);
    ++tiles;
  }
  EXPECT_GT(tiles, 4);
}

TEST(Holes, AreKnownFromTheCache) {
  const TempDir dir;
  const VoidAt is_void = [](int c, int r) { return Box(900, 80, 300, 90)(c, r) || Box(0, 0, 50, 20)(c, r); };
  const std::string path = WriteRaster(dir, Raster(1400, 300, Rough, is_void));
  const DemOptions options{.floor = kFloor, .cache = CacheIn(dir.File("cache"))};
  const auto first = OpenOrFail(path, options), second = OpenOrFail(path, options),
             none = OpenOrFail(path, {.floor = kFloor});
  ASSERT_TRUE(first && second && none);
  for (const ElevationModel* model : {first.get(), second.get(), none.get()}) {
    EXPECT_EQ(model->info().sources[0].enclosed_samples, 300u * 90u);
    EXPECT_EQ(model->info().sources[0].void_samples, 300u * 90u + 1000u);
  }
  for (const geo::TileKey& key : SomeTiles(*none, kLevel, 20)) {
    const auto a = none->Read(key), b = second->Read(key);
    ASSERT_TRUE(a && b);
    ASSERT_EQ(a->heights, b->heights);
    EXPECT_EQ(none->RangeBound(key).max, second->RangeBound(key).max);
  }
}

}  // namespace
}  // namespace terrace::dem::holes

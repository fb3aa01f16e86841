// Large voids: holes are smoothed over, collars show the floor.
#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem::holes {
namespace {

constexpr double kPixel = 1.0 / 3600;
constexpr double kVoid = -9999;

using IsVoid = std::function<bool(int, int)>;

// A plane, 7 and 4 metres from one sample to the next, with voids.
double Plane(double column, double row) { return 300 + 7 * column + 4 * row; }
constexpr double kSteepest = 11;  // from a sample to the one beside and below it

RasterSpec Holed(int width, int height, const IsVoid& is_void) {
  RasterSpec spec{.width = width, .height = height, .geo_transform = {10, kPixel, 0, 20, 0, -kPixel}, .nodata = kVoid};
  spec.value = [is_void](int c, int r) { return is_void(c, r) ? kVoid : Plane(c, r); };
  return spec;
}

IsVoid Box(int column, int row, int columns, int rows) {
  return [=](int c, int r) { return c >= column && c < column + columns && r >= row && r < row + rows; };
}

double Rough(int column, int row) {
  std::uint32_t hash = static_cast<std::uint32_t>(column) * 73856093u ^ static_cast<std::uint32_t>(row) * 19349663u;
  hash = (hash ^ hash >> 13) * 0x5bd1e995u;
  return 800 + 300 * std::sin(column * 0.05) * std::cos(row * 0.07) + (hash >> 16 & 1023) * 0.03;
}

// Pixels of a node of a tile.
struct Pixel {
  double x, y;
};
Pixel PixelOf(const TileHeights& tile, const geo::TileKey& key, int i, int j) {
  const double longitude = tile.lattice.Longitude(tile.lattice.FirstColumn(key) + i);
  const double latitude = tile.lattice.Latitude(tile.lattice.FirstRow(key) + j);
  return {(longitude - 10) / kPixel - 0.5, (20 - latitude) / kPixel - 0.5};
}

// Calls visit(height, pixel, tile, i, j) for all nodes of a level's tiles.
template <typename Visit>
void ForNodes(const DemSource& source, int level, const Visit& visit) {
  for (const geo::TileKey& key : SomeTiles(source, level, 1 << 20)) {
    const auto tile = source.Read(key);
    ASSERT_TRUE(tile) << tile.error().message;
    for (int j = 0; j <= tile->lattice.cells; ++j) {
      for (int i = 0; i <= tile->lattice.cells; ++i) visit(tile->At(i, j), PixelOf(*tile, key, i, j), *tile, i, j);
    }
  }
}

TEST(Holes, OfAPlaneGoOnWithThePlane) {
  for (const int margin : {1, 20, 150}) {
    SCOPED_TRACE(margin);
    const TempDir dir;
    const int side = 300 + 2 * margin;
    const auto source = OpenOrFail(WriteRaster(dir, Holed(side, side, Box(margin, margin, 300, 300))), {.floor = -500});
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->info().sources[0].hole_samples, 300u * 300u);
    double farthest = 0, steepest = 0;
    int inside = 0;
    ForNodes(*source, source->max_level(), [&](float height, const Pixel& at, const TileHeights& tile, int i, int j) {
      if (at.x < 0.5 || at.y < 0.5 || at.x > side - 1.5 || at.y > side - 1.5) return;
      farthest = std::max(farthest, std::abs(height - Plane(at.x, at.y)));
      steepest = std::max({steepest, std::abs(double{tile.At(i + 1, j)} - height),
                           std::abs(double{tile.At(i, j + 1)} - height)});
      inside += at.x > margin && at.x < margin + 299 && at.y > margin && at.y < margin + 299;
    });
    EXPECT_GT(inside, 300 * 300 / 2);
    RecordProperty("farthest_m", std::to_string(farthest));
    std::printf("margin %d: farthest %g steepest %g\n", margin, farthest, steepest);
  }
}

}  // namespace
}  // namespace terrace::dem::holes

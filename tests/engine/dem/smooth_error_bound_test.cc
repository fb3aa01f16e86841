// The bound of a box does not depend on prepared tables.
#include "engine/bound/smooth_error_bound.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "engine/bound/geoid_error_bound.h"
#include "engine/bound/grid_statistics.h"
#include "engine/crs/node_positions.h"
#include "engine/mosaic/raster_grid.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

TEST(SmoothErrorBound, IsTheSameWithAndWithoutPreparedRows) {
  const TempDir dir;
  std::mt19937 random(11);
  RasterSpec spec;
  spec.width = 300, spec.height = 200;
  spec.geo_transform = {7, 0.01, 0, 47, 0, -0.01};
  spec.value = [&](int column, int row) {
    const bool is_void = column % 97 == 0 && row % 61 == 0;
    return is_void ? -9999 : 500 + 300 * std::sin(column * 0.3) * std::cos(row * 0.2) + static_cast<int>(random() % 50);
  };
  spec.nodata = -9999;
  auto raster = RasterSource::Open(WriteRaster(dir, spec));
  ASSERT_TRUE(raster) << raster.error().message;
  std::vector<GridPlan> plans = PlanGrids({*std::move(raster)});
  const auto grid = RasterGrid::Make(std::move(plans.front()), {});
  ASSERT_TRUE(grid);
  int known = 0, unknown = 0;
  for (const int level : {7, 8, 9, 10}) {
    const geo::Lattice lattice{level, 64};
    const double tile = 180.0 / (1 << level);
    for (int x = static_cast<int>(187 / tile); x <= static_cast<int>(190 / tile); ++x) {
      const geo::TileKey key{level, x, static_cast<std::int64_t>(136 / tile)};
      const NodeWindow window = WindowOfTile(lattice, key);
      std::vector<float> heights(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                                 SampleRules::kVoid);
      GridReading reading;
      ASSERT_TRUE(grid->FillNodes(lattice, window, HeightDatum::kEllipsoid, {heights}, {}, &reading));
      const TileNodes nodes{lattice, window, heights};
      const GridStatistics statistics(*grid, reading);
      const GeoidErrorBound geoid(nodes, nullptr, {});
      SmoothErrorBound plain(nodes, *grid, reading, statistics, geoid, false);
      SmoothErrorBound prepared(nodes, *grid, reading, statistics, geoid, false);
      for (int south = 0; south < lattice.cells; south += 16) {
        prepared.PrepareRows(south, south + 16);
        for (int west = 0; west < lattice.cells; west += 8) {
          for (const CellBox& box :
               {CellBox{west, south, west + 8, south + 16}, CellBox{west, south + 4, west + 4, south + 8}}) {
            const double expected = plain.BoundOver(box), bound = prepared.BoundOver(box);
            ASSERT_EQ(std::isfinite(expected), std::isfinite(bound));
            (std::isfinite(expected) ? known : unknown) += 1;
            if (!std::isfinite(expected)) continue;
            ASSERT_EQ(expected, bound) << level << ' ' << x << ' ' << south << ' ' << west;
          }
        }
      }
    }
  }
  EXPECT_GT(known, 500);
  EXPECT_GT(unknown, 20);
}

}  // namespace
}  // namespace terrace::dem

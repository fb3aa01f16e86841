// The pieces of rays, and the blocks of samples that are kept for them.
#include "engine/sight/sight_track.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/sight/grid_sight.h"
#include "engine/sight/sight_search.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

// A shift grid of the datum may end beside the raster.
TEST(SightTrack, SeesTheGroundBehindPlacesWithoutAPosition) {
  const TempDir dir;
  RasterSpec spec{.width = 360, .height = 180, .geo_transform = {-180, 1, 0, 90, 0, -1}};
  auto raster = RasterSource::Open(WriteRaster(dir, spec));
  ASSERT_TRUE(raster) << raster.error().message;
  std::vector<TrackPiece> pieces = PiecesOf({{178.5, 10, 0}, {-178.5, 10, 0}}, {});
  ASSERT_GT(pieces.size(), 10u);
  constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();
  for (const std::size_t i : {std::size_t{0}, pieces.size() / 3, pieces.size() - 2}) {
    pieces[i].longitude = {kNowhere, kNowhere, kNowhere};
  }
  const std::vector<PieceOnGrid> on_grid = OnGrid(pieces, (*raster)->georeference());
  for (const double share : {0.2, 0.5, 0.8, 1.0}) {
    for (const PieceOnGrid& piece : on_grid) {
      if (share <= piece.track.start || share > piece.track.end) continue;
      const double s = (share - piece.track.start) / (piece.track.end - piece.track.start);
      EXPECT_NEAR(piece.x.At(s), 358 + 3 * share, 0.01) << share;
    }
  }
}

// A ray through a pole has few short pieces.
TEST(SightTrack, HasFewPiecesPastAPole) {
  EXPECT_LT(PiecesOf({{0, 60, 3000}, {180, 80, 3000}}, {}).size(), 6000u);
  EXPECT_EQ(PiecesOf({{0, 0, 3000}, {0.5, 0, 3000}}, {}).size(), 7u);
  for (const double latitude : {90.0, 89.99999}) {  // upwards
    EXPECT_LT(PiecesOf({{0, latitude, 1000}, {0, latitude, 1e6}}, {}).size(), 140u);
  }
}

// A rising strip of 400 blocks: the farther to the south, the less a level ray is above it, so none of them is skipped.
TEST(SightTrack, KeepsFewBlocksInMemory) {
  const TempDir dir;
  constexpr int kRows = 256 * 400;
  RasterSpec spec{.width = 2, .height = kRows, .geo_transform = {10, 1e-6, 0, 46, 0, -1e-6}};
  spec.value = [](int, int row) { return row * 0.01; };
  auto raster = RasterSource::Open(WriteRaster(dir, spec));
  ASSERT_TRUE(raster) << raster.error().message;
  std::vector<GridPlan> plans = PlanGrids({*std::move(raster)});
  const auto grid = RasterGrid::Make(std::move(plans.front()), {});
  ASSERT_TRUE(grid);
  const auto look = [&](GridSights& sights, std::size_t number, double first_row, double last_row) {
    const auto at = [](double row) { return SightPoint{10 + 1e-6, 46 - (row + 0.5) * 1e-6, 2000}; };
    const std::vector<RayPart> whole = {{0, 1}};
    SightSearch search;
    const std::vector<TrackPiece> pieces = PiecesOf({at(first_row), at(last_row)}, {});
    const auto open = sights.Of(number, *grid).Search(pieces, whole, SightSurface::kAll, search, {});
    EXPECT_TRUE(open);
    EXPECT_NEAR(search.Answer(false).clearance_m, 2000 - last_row * 0.01, 0.1);
  };
  std::size_t most = 0;
  GridSights of_one_ray;
  look(of_one_ray, 0, 1, kRows - 10);
  EXPECT_LE(of_one_ray.blocks(), kMaxSightBlocks + 1);
  GridSights of_many_rays, of_many_grids;
  for (int block = 0; block < 400; ++block) {
    look(of_many_rays, 0, 256 * block + 1, 256 * block + 250);
    look(of_many_grids, static_cast<std::size_t>(block), 256 * block + 1, 256 * block + 250);
    most = std::max({most, of_many_rays.blocks(), of_many_grids.blocks()});
  }
  EXPECT_LE(most, kMaxSightBlocks + 1);
  EXPECT_GT(most, 100u);
}

}  // namespace
}  // namespace terrace::dem

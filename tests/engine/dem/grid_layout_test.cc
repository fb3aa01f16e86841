// Grouping many rasters into raster grids gives the same result as comparing all pairs, but compares few pairs.
#include "engine/mosaic/grid_layout.h"

#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <tuple>
#include <vector>

#include "engine/geo/tile_cover.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

Georeference PlaceOf(const RasterSpec& spec) {
  GDALAllRegister();
  GDALDriver* memory = GetGDALDriverManager()->GetDriverByName("MEM");
  const GDALDatasetUniquePtr dataset(memory->Create("", spec.width, spec.height, 0, GDT_Byte, nullptr));
  std::array<double, 6> transform = spec.geo_transform;
  dataset->SetGeoTransform(transform.data());
  OGRSpatialReference srs;
  srs.SetFromUserInput(spec.crs.c_str());
  srs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  dataset->SetSpatialRef(&srs);
  auto where = Georeference::Of(*dataset, "memory");
  EXPECT_TRUE(where.has_value()) << where.error().message;
  return *std::move(where);
}

// The oracle: compares every raster with every grid, and every member with every other one.
class Pairs {
 public:
  static std::vector<GridLayout> LayOut(const std::vector<PlacedRaster>& rasters) {
    struct Grid {
      const PlacedRaster* first;
      std::vector<LaidRaster> members;
    };
    std::vector<Grid> grids;
    for (std::size_t i = 0; i < rasters.size(); ++i) {
      std::optional<PixelOffset> offset;
      const auto fits = [&](const Grid& grid) {
        offset = grid.first->vertical->IsSame(*rasters[i].vertical) ? grid.first->where->OffsetOf(*rasters[i].where)
                                                                    : std::nullopt;
        return offset.has_value();
      };
      auto grid = std::ranges::find_if(grids, fits);
      if (grid == grids.end()) {
        offset = PixelOffset{};
        grid = grids.insert(grids.end(), Grid{&rasters[i], {}});
      }
      grid->members.push_back({i, offset->column, offset->row});
    }
    std::vector<GridLayout> layouts;
    for (Grid& grid : grids) {
      for (const std::vector<LaidRaster>& group : GroupsOf(grid.members, rasters)) {
        layouts.push_back(Counted(group, rasters));
      }
    }
    std::ranges::sort(layouts, {}, [](const GridLayout& layout) { return layout.members.front().raster; });
    return layouts;
  }

 private:
  static geo::TileRange PixelsOf(const LaidRaster& member, const std::vector<PlacedRaster>& rasters) {
    const Georeference& where = *rasters[member.raster].where;
    return {member.column, member.row, member.column + where.width() - 1, member.row + where.height() - 1};
  }

  static std::int64_t TurnOf(const PlacedRaster& raster) {
    const double period = raster.where->period();
    return period > 0 && std::abs(period - std::round(period)) < 0.01 ? std::llround(period) : 0;
  }

  static std::vector<std::vector<LaidRaster>> GroupsOf(std::vector<LaidRaster> waiting,
                                                       const std::vector<PlacedRaster>& rasters) {
    const std::int64_t turn = TurnOf(rasters[waiting.front().raster]);
    std::vector<std::vector<LaidRaster>> groups;
    while (!waiting.empty()) {
      std::vector<LaidRaster> group = {waiting.front()};
      waiting.erase(waiting.begin());
      for (std::size_t done = 0; done < group.size(); ++done) {
        const geo::TileRange here = PixelsOf(group[done], rasters);
        std::vector<LaidRaster> left;
        for (LaidRaster other : waiting) {
          const std::int64_t column = other.column;
          const auto nearest =
              turn == 0 ? 0 : std::llround(static_cast<double>(here.start_x - column) / static_cast<double>(turn));
          bool touches = false;
          for (const std::int64_t more : {0, -1, 1}) {
            other.column = column + (nearest + more) * turn;
            const geo::TileRange there = PixelsOf(other, rasters);
            touches = there.start_x <= here.end_x + 1 && there.end_x >= here.start_x - 1 &&
                      there.start_y <= here.end_y + 1 && there.end_y >= here.start_y - 1;
            if (touches || turn == 0) break;
          }
          if (touches) {
            group.push_back(other);
          } else {
            other.column = column;
            left.push_back(other);
          }
        }
        waiting = std::move(left);
      }
      std::ranges::sort(group, {}, &LaidRaster::raster);
      groups.push_back(std::move(group));
    }
    return groups;
  }

  static GridLayout Counted(const std::vector<LaidRaster>& group, const std::vector<PlacedRaster>& rasters) {
    geo::TileRange hull = PixelsOf(group.front(), rasters);
    for (const LaidRaster& member : group) hull = geo::BoundingRange(hull, PixelsOf(member, rasters));
    const std::int64_t turn = TurnOf(rasters[group.front().raster]);
    const bool around = turn > 0 && group.size() > 1 && hull.end_x - hull.start_x + 1 >= turn;
    if (around) {
      const auto west = [&](const LaidRaster& member) {
        Position corner{0, 0};
        rasters[member.raster].where->ToDegrees({&corner, 1});
        return corner.x;
      };
      hull.start_x = std::ranges::min_element(group, {}, west)->column;
      hull.end_x = hull.start_x + turn - 1;
    }
    GridLayout layout{group, static_cast<int>(hull.end_x - hull.start_x + 1),
                      static_cast<int>(hull.end_y - hull.start_y + 1)};
    for (LaidRaster& member : layout.members) {
      member.column -= hull.start_x;
      member.row -= hull.start_y;
      if (around) member.column = (member.column % turn + turn) % turn;
    }
    return layout;
  }
};

// Random rasters whose pixels nearly or exactly agree, separate or overlapping, in degrees around the Earth and in
// metres, and as in real files: some with fewer digits, some on other grids.
class Layouts {
 public:
  explicit Layouts(unsigned seed) : random_(seed) {}

  std::vector<PlacedRaster> Next() {
    places_.clear();
    const bool degrees = Pick(10) > 0;  // projections are slow
    const int count = 2 + Pick(degrees ? 50 : 12);
    const double pixel = degrees ? 360.0 / (60 + 60 * Pick(4) + (Pick(4) == 0 ? 1 : 0)) : 10.0 * (1 + Pick(3));
    const int across = degrees ? static_cast<int>(std::lround(360 / pixel)) : 200;
    const int side = 2 + Pick(degrees ? across / (1 + Pick(5)) : 90);
    for (int i = 0; i < count; ++i) {
      RasterSpec spec;
      spec.width = 2 + Pick(side), spec.height = 2 + Pick(20);
      spec.crs = degrees ? Pick(30) == 0 ? "EPSG:4267" : "EPSG:4326" : "EPSG:32611";
      const double own = pixel * (Pick(12) == 0 ? 1 + 1e-5 * (Pick(5) - 2) : Pick(8) == 0 ? 1 + 1e-13 : 1);
      const double column = Pick(across) + Off(), row = Pick(120) + Off();
      spec.geo_transform = {(degrees ? -180 : 500'000) + column * pixel + (degrees && Pick(9) == 0 ? 360 : 0),
                            own,
                            0,
                            (degrees ? 80 : 4'000'000) - row * pixel * (degrees ? 0.2 : 1),
                            0,
                            degrees ? -own * 0.2 : -own};
      places_.push_back(PlaceOf(spec));
    }
    std::vector<PlacedRaster> placed;
    for (const Georeference& place : places_) placed.push_back({&place, &verticals_[Pick(20) == 0 ? 1 : 0]});
    return placed;
  }

 private:
  int Pick(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }
  // An offset in pixels: none, within the tolerance, close to it, or arbitrary.
  double Off() {
    switch (Pick(16)) {
      case 0:
        return 0.009;
      case 1:
        return -0.009;
      case 2:
        return 0.0101;
      case 3:
        return Pick(100) * 0.01;
      case 4:
        return 0.999;
      default:
        return 0;
    }
  }

  std::mt19937 random_;
  const std::vector<VerticalDatum> verticals_ = {{"", nullptr}, {"ellipsoid", nullptr}};
  std::vector<Georeference> places_;
};

TEST(GridLayout, ManyRastersMakeTheGridsThatAllPairsMake) {
  Layouts layouts(7);
  int joined = 0, apart = 0, around = 0;
  for (int round = 0; round < 60; ++round) {
    const std::vector<PlacedRaster> rasters = layouts.Next();
    const std::vector<GridLayout> expected = Pairs::LayOut(rasters), found = LayOutGrids(rasters);
    ASSERT_EQ(found.size(), expected.size()) << round;
    for (std::size_t k = 0; k < found.size(); ++k) {
      ASSERT_EQ(found[k].width, expected[k].width) << round;
      ASSERT_EQ(found[k].height, expected[k].height) << round;
      ASSERT_EQ(found[k].members.size(), expected[k].members.size()) << round;
      for (std::size_t m = 0; m < found[k].members.size(); ++m) {
        const auto parts = [](const LaidRaster& member) {
          return std::tuple(member.raster, member.column, member.row);
        };
        ASSERT_EQ(parts(found[k].members[m]), parts(expected[k].members[m])) << round;
      }
      (found[k].members.size() > 1 ? joined : apart) += 1;
      const double period = rasters[found[k].members.front().raster].where->period();
      around += found[k].members.size() > 1 && found[k].width == std::lround(period);
    }
  }
  // Checks that the layouts test what they are for.
  EXPECT_GT(joined, 40);
  EXPECT_GT(apart, 150);
  EXPECT_GT(around, 4);
}

// Cells of one degree that touch, and as many of the same pixel size that are each on a different grid.
TEST(GridLayout, RastersAreComparedWithFewOthers) {
  const auto pairs_per_raster = [](int across) {
    std::vector<Georeference> places;
    for (int k = 0; k < 2 * across * across; ++k) {
      const int column = k / 2 % across, row = k / 2 / across;
      const double pixel = 1.0 / 60;
      const auto off = [&](int cell) { return k % 2 == 0 ? 0 : pixel * (0.02 + 0.96 * cell / across); };
      RasterSpec spec;
      spec.width = spec.height = 60;
      spec.geo_transform = {-170.0 + column + off(column), pixel, 0, 80.0 - row + off(row), 0, -pixel};
      places.push_back(PlaceOf(spec));
    }
    const VerticalDatum vertical{"", nullptr};
    std::vector<PlacedRaster> rasters;
    for (const Georeference& place : places) rasters.push_back({&place, &vertical});
    std::size_t pairs = 0;
    EXPECT_EQ(LayOutGrids(rasters, &pairs).size(), rasters.size() / 2 + 1);
    return static_cast<double>(pairs) / static_cast<double>(rasters.size());
  };
  const double few = pairs_per_raster(8), many = pairs_per_raster(32);
  EXPECT_GT(few, 0.5);
  EXPECT_LT(many, 4) << "all pairs would be 1,024 a raster";
  EXPECT_LT(many, 2 * few);
}

}  // namespace
}  // namespace terrace::dem

// Positions of nodes that are interpolated are those of PROJ, within what the certified error allows for.
#include "engine/crs/node_positions.h"

#include <fmt/format.h>
#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "engine/crs/footprint.h"
#include "engine/crs/georeference.h"

namespace terrace::dem {
namespace {

constexpr double kPositionTolerance = 1e-5;

// A raster of 4096 x 4096 pixels. `west`, `north`, `pixel`: in the CRS's units.
Result<Georeference> MakeGeoreference(const std::string& crs, double west, double north, double pixel) {
  const std::string vrt = fmt::format(
      "<VRTDataset rasterXSize='4096' rasterYSize='4096'><SRS>{}</SRS><GeoTransform>{}, {}, 0, {}, 0, {}</GeoTransform>"
      "<VRTRasterBand dataType='Int16' band='1'/></VRTDataset>",
      crs, west, pixel, north, -pixel);
  GDALAllRegister();
  const std::unique_ptr<GDALDataset> dataset(GDALDataset::Open(vrt.c_str(), GDAL_OF_RASTER));
  if (dataset == nullptr) return MakeError(ErrorCode::kInvalidArgument, "{} cannot be opened", crs);
  return Georeference::Of(*dataset, crs);
}

struct ProjectedRaster {
  const char* name;
  const char* crs;
  double west, north, pixel;
  double latitude, longitude;  // near the raster's centre
};

class NodePositionsAt : public testing::TestWithParam<ProjectedRaster> {};

TEST_P(NodePositionsAt, AreThoseOfProjAndTheSameInEveryWindow) {
  const ProjectedRaster& raster = GetParam();
  const auto georeference = MakeGeoreference(raster.crs, raster.west, raster.north, raster.pixel);
  ASSERT_TRUE(georeference) << georeference.error().message;
  const Footprint footprint = Footprint::Of(*georeference).Padded();
  std::mt19937 random(3);
  const auto pick = [&](int count) { return static_cast<int>(random() % static_cast<unsigned>(count)); };
  std::size_t compared = 0;
  for (int level = 0; level <= 20; ++level) {
    for (const int cells : {64, 128, 256}) {
      const geo::Lattice lattice{level, cells};
      // Near the raster's centre, where it is larger than the window, and anywhere around the Earth at small levels.
      const double step = lattice.StepDegrees();
      const std::int64_t column = static_cast<std::int64_t>((raster.longitude + 180) / step) + pick(400) - 330;
      const std::int64_t row = static_cast<std::int64_t>((raster.latitude + 90) / step) + pick(400) - 330;
      const NodeWindow window{column, row, 2 + pick(260), 2 + pick(260)};
      const NodePositions all = NodePositions::Of(*georeference, footprint, lattice, window, kPositionTolerance);
      ASSERT_FALSE(all.is_separable());
      for (std::int64_t r = 0; r < window.rows; ++r) {
        if (geo::NodeGrid(lattice).IsPoleRow(row + r)) continue;
        std::vector<Position> exact;
        for (std::int64_t c = 0; c < window.columns; ++c) {
          exact.push_back({lattice.Longitude(column + c), lattice.Latitude(row + r)});
        }
        georeference->ToPixels(exact);
        for (std::size_t c = 0; c < exact.size(); ++c) {
          const Position found = all.At(c, static_cast<std::size_t>(r));
          const bool is_near = exact[c].x > -1 && exact[c].x < 4097 && exact[c].y > -1 && exact[c].y < 4097;
          if (!is_near) continue;
          ++compared;
          ASSERT_NEAR(found.x, exact[c].x, 2 * kPositionTolerance)
              << level << ' ' << column + static_cast<int>(c) << ' ' << row + r;
          ASSERT_NEAR(found.y, exact[c].y, 2 * kPositionTolerance)
              << level << ' ' << column + static_cast<int>(c) << ' ' << row + r;
        }
      }
      const NodeWindow part{column + pick(window.columns), row + pick(window.rows), 1 + pick(300), 1 + pick(300)};
      const NodePositions other = NodePositions::Of(*georeference, footprint, lattice, part, kPositionTolerance);
      for (std::int64_t r = part.row; r < std::min(part.row + part.rows, row + window.rows); ++r) {
        for (std::int64_t c = part.column; c < std::min(part.column + part.columns, column + window.columns); ++c) {
          const Position a = all.OfNode(c, r), b = other.OfNode(c, r);
          ASSERT_EQ(std::bit_cast<std::uint64_t>(a.x), std::bit_cast<std::uint64_t>(b.x))
              << level << ' ' << c << ' ' << r;
          ASSERT_EQ(std::bit_cast<std::uint64_t>(a.y), std::bit_cast<std::uint64_t>(b.y))
              << level << ' ' << c << ' ' << r;
        }
      }
    }
  }
  EXPECT_GT(compared, 100'000U);
}

INSTANTIATE_TEST_SUITE_P(ReferenceSystems, NodePositionsAt,
                         testing::Values(ProjectedRaster{"Utm", "EPSG:32611", 340000, 3860000, 30, 34.3, -118.1},
                                         ProjectedRaster{"UtmMetre", "EPSG:32612", 560000, 4310000, 1, 38.93, -110.28},
                                         ProjectedRaster{"Mercator", "EPSG:3857", 1e6, 6e6, 30, 46.9, 9.5},
                                         ProjectedRaster{"EqualArea", "EPSG:3035", 4.2e6, 2.7e6, 90, 46.2, 10.2},
                                         ProjectedRaster{"Antarctica", "EPSG:3031", -2e5, 2e5, 100, -88.5, 30},
                                         ProjectedRaster{"Arctic", "EPSG:3413", -1e6, -1e6, 250, 75.6, -62.9},
                                         ProjectedRaster{"Mollweide", "ESRI:54009", 5e5, 5.4e6, 100, 43.5, 11},
                                         ProjectedRaster{"Conic", "EPSG:2154", 8e5, 6.6e6, 25, 46, 5},
                                         ProjectedRaster{"Datum", "EPSG:4277", -3, 54, 0.0002, 53.6, -2.6}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace terrace::dem

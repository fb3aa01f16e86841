// Heights, normals and lines of sight of the drawn surface where clients draw nothing.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "tests/support/scratch_directory.h"
#include "tests/support/source_dir.h"
#include "tiler/store/baked_tiles.h"
#include "tiler/surface/drawn_mesh.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

// In the middle of config/samples/jacksboro.tif.
constexpr double kLongitude = -84.1985, kLatitude = 36.2992;
constexpr int kLevel = 12;  // tiles of 0.044 degrees

// A dataset with a square hole of two times `reach` degrees; 0: without a hole.
TilePipeline OpenWithHole(double reach) {
  const test_support::ScratchDirectory dir;
  dem::DemOptions options;
  if (reach > 0) {
    const std::string path = dir.path() / "hole.geojson";
    const double west = kLongitude - reach, east = kLongitude + reach;
    const double south = kLatitude - reach, north = kLatitude + reach;
    std::ofstream(path) << fmt::format(
        R"({{"type":"FeatureCollection","features":[{{"type":"Feature","properties":{{"terrain":{{"op":"hole"}}}},
        "geometry":{{"type":"Polygon","coordinates":[[[{0},{1}],[{2},{1}],[{2},{3}],[{0},{3}],[{0},{1}]]]}}}}]}})",
        west, south, east, north);
    options.edits = {path};
  }
  auto source =
      dem::ElevationModel::Open((test_support::SourceDir() / "config/samples/jacksboro.tif").string(), options);
  EXPECT_TRUE(source.has_value()) << (source ? "" : source.error().message);
  Dataset dataset;
  dataset.name = "holed";
  dataset.model = *std::move(source);
  dataset.generation = dataset.model->fingerprint();
  dataset.unedited_generation = dataset.model->unedited_fingerprint();
  std::vector<Dataset> datasets;
  datasets.push_back(std::move(dataset));
  return TilePipeline(std::move(datasets));
}

DrawnSurface SurfaceOf(TileFormat format) { return {kLevel, {}, format, proto::GlbCompression::kDraco}; }

constexpr std::array kFormats = {TileFormat::kQuantizedMesh, TileFormat::kGlb};

TEST(DrawnHoles, HaveNeitherHeightsNorNormals) {
  const TilePipeline plain = OpenWithHole(0), holed = OpenWithHole(0.012), wide = OpenWithHole(0.1);
  const double inside = 0.009, outside = 0.015;
  const std::array points = {
      dem::GeoPosition{kLongitude, kLatitude}, dem::GeoPosition{kLongitude - inside, kLatitude + inside},
      dem::GeoPosition{kLongitude + outside, kLatitude}, dem::GeoPosition{kLongitude, kLatitude - outside}};
  for (const TileFormat format : kFormats) {
    const auto whole = plain.ReadDrawnPoints(0, SurfaceOf(format), points, /*normals=*/true, {});
    const auto cut = holed.ReadDrawnPoints(0, SurfaceOf(format), points, /*normals=*/true, {});
    const auto none = wide.ReadDrawnPoints(0, SurfaceOf(format), points, /*normals=*/true, {});
    ASSERT_TRUE(whole && cut && none);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool in_hole = i < 2;
      EXPECT_FALSE(std::isnan(whole->heights[i])) << i;
      EXPECT_EQ(std::isnan(cut->heights[i]), in_hole) << i;
      // Within the errors of both.
      EXPECT_TRUE(in_hole || std::abs(cut->heights[i] - whole->heights[i]) < 40) << i;
      // Tiles that are wholly in the hole.
      EXPECT_TRUE(std::isnan(none->heights[i])) << i;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(std::isnan(cut->normals[i][axis]), in_hole) << i;
        EXPECT_TRUE(std::isnan(none->normals[i][axis])) << i;
      }
    }
  }
}

TEST(DrawnHoles, BlockNoRay) {
  const TilePipeline plain = OpenWithHole(0), holed = OpenWithHole(0.012), wide = OpenWithHole(0.1);
  // Straight down through the hole, and below the ground from hole to ground.
  const std::array rays = {dem::SightRay{{kLongitude - 0.002, kLatitude, 2000}, {kLongitude + 0.002, kLatitude, -2000}},
                           dem::SightRay{{kLongitude, kLatitude, -100}, {kLongitude + 0.018, kLatitude, -100}}};
  for (const TileFormat format : kFormats) {
    const auto whole = plain.LookAlong(0, SurfaceOf(format), rays, {}, {});
    const auto cut = holed.LookAlong(0, SurfaceOf(format), rays, {}, {});
    const auto none = wide.LookAlong(0, SurfaceOf(format), rays, {}, {});
    ASSERT_TRUE(whole && cut && none) << (cut ? "" : cut.error().message);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      EXPECT_FALSE((*whole)[i].is_visible || (*whole)[i].has_gaps) << i;
      EXPECT_TRUE((*cut)[i].has_gaps && (*none)[i].has_gaps) << i;
      EXPECT_TRUE((*none)[i].is_visible && std::isnan((*none)[i].clearance_m)) << i;
    }
    EXPECT_TRUE((*cut)[0].is_visible && std::isnan((*cut)[0].clearance_m));
    ASSERT_TRUE((*cut)[1].blocked_at.has_value());
    EXPECT_NEAR(*(*cut)[1].blocked_at, 0.012 / 0.018, 0.06);  // the outline follows the lattice
  }
}

// All levels to 20, with tiles that cannot be read.
class UnreadableArchive final : public BakedTiles {
 public:
  UnreadableArchive() {
    extent_.formats = {TileFormat::kQuantizedMesh};
    for (int level = 0; level <= 20; ++level) {
      extent_.available.push_back({{0, 0, geo::TileColumns(level) - 1, geo::TileRows(level) - 1}});
    }
  }
  Coding coding() const override { return Coding::kGzip; }
  const BakedExtent& extent() const override { return extent_; }
  Result<std::optional<EncodedTile>> Find(const TileRequest&) const override {
    return MakeError(ErrorCode::kUnavailable, "unreadable");
  }
  Result<dem::HeightRange> RangeBound(const geo::TileKey&) const override { return dem::HeightRange(); }
  bool HasKind(const TileRequest&) const override { return true; }
  bool is_outdated() const override { return false; }
  Error WhyAbsent(const TileRequest&) const override { return {}; }

 private:
  BakedExtent extent_;
};

TEST(DrawnSight, OverArchivesAloneIsBoundedToo) {
  std::vector<Dataset> datasets(1);
  datasets.front().name = "archive";
  datasets.front().baked = std::make_shared<const UnreadableArchive>();
  const TilePipeline pipeline(std::move(datasets));
  const auto refusal_of = [&](int level, std::size_t count) {
    DrawnSurface surface;
    surface.level = level;
    const std::vector<dem::SightRay> rays(count, {{0, 0, 9000}, {26, 0, 9000}});  // 2,894 km
    const auto answers = pipeline.LookAlong(0, surface, rays, {}, {});
    EXPECT_FALSE(answers);
    return answers ? "" : answers.error().message;
  };
  // Tiles of level 20 have a side of 19 m, so 2 * 10^8 samples are 14,900 km of them.
  EXPECT_NE(refusal_of(20, 6).find("the rays together cross"), std::string::npos) << refusal_of(20, 6);
  EXPECT_NE(refusal_of(20, 5).find("unreadable"), std::string::npos) << refusal_of(20, 5);
  EXPECT_NE(refusal_of(10, 6).find("unreadable"), std::string::npos) << refusal_of(10, 6);
  EXPECT_NE(refusal_of(5, 40'000).find("the rays together cross"), std::string::npos) << "one every 500 m";
}

// Triangles of a whole hemisphere, each of which lies in every bucket.
TEST(DrawnMesh, KeepsBucketsSmall) {
  DrawnTriangles drawn;
  constexpr std::uint32_t kTriangles = 20000;
  const auto add = [&](double u, double v) {
    drawn.positions.push_back(geo::ToEcef(-180 + 180 * u, -90 + 180 * v, 0));
    drawn.places.push_back({u, v});
  };
  for (std::uint32_t t = 0; t < kTriangles; ++t) {
    add(0, 0.1), add(1, 0.1), add(0.5, 0.9);
    drawn.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  const DrawnMesh mesh({0, 0, 0}, std::move(drawn));
  EXPECT_LT(mesh.bytes(), kTriangles * 200u);
}

// Triangles of a rough grid over a tile; `keeps` says which of its cells have theirs.
template <typename Keeps>
DrawnTriangles RoughGrid(const geo::TileKey& key, const Keeps& keeps) {
  constexpr int kCells = 40;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> height(0, 400), shift(-0.2, 0.2);
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  DrawnTriangles drawn;
  for (int row = 0; row <= kCells; ++row) {
    for (int column = 0; column <= kCells; ++column) {
      const bool is_rim = row % kCells == 0 || column % kCells == 0;
      const double u = (column + (is_rim ? 0 : shift(random))) / kCells;
      const double v = (row + (is_rim ? 0 : shift(random))) / kCells;
      drawn.positions.push_back(geo::ToEcef((static_cast<double>(key.x) + u) * side - 180,
                                            (static_cast<double>(key.y) + v) * side - 90, height(random)));
      drawn.places.push_back({u, v});
      if (row == kCells || column == kCells || !keeps(column, row)) continue;
      const auto at = static_cast<std::uint32_t>(row * (kCells + 1) + column);
      drawn.triangles.push_back({at, at + 1, at + kCells + 2});
      drawn.triangles.push_back({at, at + kCells + 2, at + kCells + 1});
    }
  }
  return drawn;
}

// The distance of a triangle in the plane of east and north at a point, and the height of its nearest place.
struct Flat {
  double distance_m, height_m;
};
Flat FlatAt(const dem::GeoPosition& point, const std::array<geo::Vec3, 3>& corners) {
  const geo::Vec3 start = geo::ToEcef(point.longitude, point.latitude, 0);
  const geo::Vec3 up = geo::SurfaceNormal(point.longitude, point.latitude),
                  meridian = geo::SurfaceNormal(point.longitude, 0);
  const geo::Vec3 east{-meridian.y, meridian.x, 0}, north = geo::Cross(up, east);
  std::array<std::array<double, 3>, 3> at{};
  for (std::size_t k = 0; k < 3; ++k) {
    const geo::Vec3 d = corners[k] - start;
    at[k] = {geo::Dot(d, east), geo::Dot(d, north), geo::Dot(d, up)};
  }
  double distance_m = std::numeric_limits<double>::infinity(), nearest_m = 0, area = 0, height_m = 0;
  bool is_inside = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& [x, y, z] = at[k];
    const auto& [x2, y2, z2] = at[(k + 1) % 3];
    const double part = x * y2 - x2 * y;  // of the triangle with the third corner at the point
    is_inside &= part >= 0;
    area += part, height_m += part * at[(k + 2) % 3][2];
    const auto distance_at = [&, x = x, y = y, x2 = x2, y2 = y2](double share) {
      return std::hypot(x + share * (x2 - x), y + share * (y2 - y));
    };
    double low = 0, high = 1;  // of the nearest place of the side
    for (int step = 0; step < 60; ++step) {
      const double a = low + (high - low) / 3, b = high - (high - low) / 3;
      if (distance_at(a) < distance_at(b)) {
        high = b;
      } else {
        low = a;
      }
    }
    if (distance_at(low) < distance_m) {
      distance_m = distance_at(low);
      nearest_m = z + low * (z2 - z);
    }
  }
  return is_inside ? Flat{0, height_m / area} : Flat{distance_m, nearest_m};
}

TEST(DrawnMesh, FindsTheNearestTriangle) {
  const geo::TileKey key{12, 1090, 2870};
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  const DrawnTriangles drawn =
      RoughGrid(key, [](int column, int row) { return (column / 3 * 7 + row / 2 * 5) % 4 == 0; });
  const DrawnMesh mesh(key, drawn);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> place(0, 1);
  std::size_t beside = 0;
  for (int i = 0; i < 60; ++i) {
    const dem::GeoPosition point{(static_cast<double>(key.x) + place(random)) * side - 180,
                                 (static_cast<double>(key.y) + place(random)) * side - 90};
    std::vector<Flat> flats;
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const auto& [a, b, c] : drawn.triangles) {
      flats.push_back(FlatAt(point, {drawn.positions[a], drawn.positions[b], drawn.positions[c]}));
      nearest_m = std::min(nearest_m, flats.back().distance_m);
    }
    const DrawnPoint found = mesh.Nearest(point);
    EXPECT_EQ(found.is_beside, nearest_m > 0) << i;
    beside += found.is_beside ? 1 : 0;
    // Of triangles around one vertex any is the nearest.
    const bool is_nearest = std::any_of(flats.begin(), flats.end(), [&](const Flat& flat) {
      return flat.distance_m <= nearest_m + 1e-5 && std::abs(flat.height_m - found.height_m) < 1e-4;
    });
    EXPECT_TRUE(is_nearest) << i << ": " << found.height_m << " m";
  }
  EXPECT_GT(beside, 20u);
  EXPECT_LT(beside, 55u);
}

// As DecodeTriangles makes them of tiles of archives, whose triangles in holes are not stored.
TEST(DrawnMesh, IsAHoleWhereNoTriangleIsNear) {
  const geo::TileKey key{12, 1090, 2870};
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  const auto at = [&](double u, double v) {
    return dem::GeoPosition{(static_cast<double>(key.x) + u) * side - 180,
                            (static_cast<double>(key.y) + v) * side - 90};
  };
  DrawnTriangles half = RoughGrid(key, [](int, int row) { return row >= 20; }), none;
  half.holes_are_left_out = none.holes_are_left_out = true;
  const DrawnMesh northern(key, std::move(half)), empty(key, std::move(none));
  EXPECT_FALSE(std::isnan(northern.Nearest(at(0.3, 0.9)).height_m));
  for (const DrawnMesh* mesh : {&northern, &empty}) {
    for (const double v : {0.0, 1e-7, 0.2}) {
      const DrawnPoint point = mesh->Nearest(at(0.3, v));
      EXPECT_TRUE(std::isnan(point.height_m) && std::isnan(point.normal.x)) << v;
      EXPECT_EQ(point.is_beside, v < 0.1) << v;  // the tile to the south may have a triangle there
    }
  }
}

}  // namespace
}  // namespace terrace::tiler

#include "proto/mesh/tile_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "tests/proto/grid_tile.h"

namespace terrace::proto {
namespace {

using geo::Vec3;

struct HeightRange {
  float min, max;
};

constexpr HeightRange kRanges[] = {{0, 0}, {0, 8800}, {-430, 1200}, {-10900, 8800}, {-10000, -9000}, {-0.25f, 0.5f}};

// Roots, poles, the antimeridian, the equator, and a level where a tile is 38 m wide.
const geo::TileKey kKeys[] = {{0, 0, 0},     {0, 1, 0},        {1, 0, 0},       {1, 3, 1},        {2, 0, 0},
                              {2, 5, 3},     {2, 3, 1},        {3, 9, 7},       {5, 20, 31},      {8, 200, 130},
                              {10, 2047, 0}, {12, 4000, 3000}, {19, 0, 524287}, {19, 1048575, 0}, {19, 524288, 262144}};

QuantizedTile RuggedTile(const geo::TileKey& key, HeightRange range) {
  const int cells = key.level < 2 ? 24 : 8;
  const QuantizedHeight flat = [](int, int) { return std::uint16_t{0}; };
  return GridTile(key, cells, cells, range.min, range.max, range.min < range.max ? Rugged() : flat);
}

// CesiumJS's EllipsoidalOccluder, for a camera and an ellipsoid whose radii are smaller by `shrink` metres.
class Occluder {
 public:
  Occluder(Vec3 camera, double shrink) : shrink_(shrink), camera_(Scaled(camera)) {}

  Vec3 Scaled(Vec3 p) const {
    return {p.x / (6378137.0 - shrink_), p.y / (6378137.0 - shrink_), p.z / (6356752.3142451793 - shrink_)};
  }
  bool IsScaledPointVisible(Vec3 point) const {
    const double limb_squared = geo::Dot(camera_, camera_) - 1;
    const Vec3 to_point = point - camera_;
    const double along = -geo::Dot(to_point, camera_);
    if (limb_squared < 0) return along <= 0;
    return !(along > limb_squared && along * along / geo::Dot(to_point, to_point) > limb_squared);
  }
  bool IsPointVisible(Vec3 p) const { return IsScaledPointVisible(Scaled(p)); }

 private:
  double shrink_;
  Vec3 camera_;
};

// Cameras at heights of 10 m to 30,000 km; from most of them the tile is close to the horizon.
std::vector<Vec3> CamerasAround(const QuantizedTile& tile, Vec3 center, int count) {
  std::mt19937 random(7);
  const auto next = [&] { return static_cast<double>(random()) / 4294967296.0; };
  const double latitude = std::atan2(center.z, std::hypot(center.x, center.y));
  const double longitude = std::atan2(center.y, center.x);
  const double half_angle = geo::ToRadians(90.0 / static_cast<double>(geo::TileRows(tile.key.level)));
  const double rise = std::acos(6356752 / (6356752 + std::max(static_cast<double>(tile.max_height), 1.0)));
  std::vector<Vec3> cameras;
  for (int i = 0; i < count; ++i) {
    const double altitude = std::pow(10.0, 1 + 6.5 * next());
    const double horizon = std::acos(6378137 / (6378137 + altitude));
    const double angle = (horizon + rise) * (0.6 + 0.6 * next()) + half_angle * next();
    const double azimuth = 2 * std::numbers::pi * next();
    const double sin_lat =
        std::sin(latitude) * std::cos(angle) + std::cos(latitude) * std::sin(angle) * std::cos(azimuth);
    const double lat = std::asin(std::clamp(sin_lat, -1.0, 1.0));
    const double lon = longitude + std::atan2(std::sin(azimuth) * std::sin(angle) * std::cos(latitude),
                                              std::cos(angle) - std::sin(latitude) * std::sin(lat));
    cameras.push_back(geo::ToEcef(geo::ToDegrees(lon), geo::ToDegrees(lat), altitude));
  }
  return cameras;
}

bool IsFinite(Vec3 p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

std::string Describe(const QuantizedTile& tile) {
  return geo::ToString(tile.key) + " from " + std::to_string(tile.min_height) + " to " +
         std::to_string(tile.max_height);
}

TEST(DecodedPositions, NeighboursShareTheirEdgeBitForBit) {
  for (int level : {1, 7, 13, 19, 24}) {
    const geo::TileKey key{level, geo::TileColumns(level) / 3, geo::TileRows(level) / 3};
    for (int value : {0, 1, 77, 16384, 32766, 32767}) {
      const auto q = static_cast<std::uint16_t>(value);
      EXPECT_EQ(LongitudeAt(key, kQuantizedMax), LongitudeAt(geo::Neighbour(key, 1, 0), 0));
      EXPECT_EQ(LatitudeAt(key, kQuantizedMax), LatitudeAt(geo::Neighbour(key, 0, 1), 0));
      EXPECT_EQ(LongitudeAt(key, q), LongitudeAt(geo::Neighbour(key, 0, 1), q));
    }
  }
}

TEST(DecodedPositions, WorldEdgesAndPolesAreExact) {
  for (int level : {0, 5, 19, 24}) {
    EXPECT_EQ(LongitudeAt({level, 0, 0}, 0), -180);
    EXPECT_EQ(LongitudeAt({level, geo::TileColumns(level) - 1, 0}, kQuantizedMax), 180);
    EXPECT_EQ(LatitudeAt({level, 0, 0}, 0), -90);
    EXPECT_EQ(LatitudeAt({level, 0, geo::TileRows(level) - 1}, kQuantizedMax), 90);
  }
}

TEST(DecodedPositions, AreLinearInTheRectangle) {
  EXPECT_DOUBLE_EQ(LongitudeAt({3, 5, 2}, 10000), -180 + 22.5 * (5 + 10000 / 32767.0));
  EXPECT_DOUBLE_EQ(LatitudeAt({3, 5, 2}, 10000), -90 + 22.5 * (2 + 10000 / 32767.0));
  QuantizedTile tile;
  tile.min_height = -100;
  tile.max_height = 555;
  EXPECT_EQ(HeightAt(tile, 0), -100);
  EXPECT_EQ(HeightAt(tile, kQuantizedMax), 555);
  EXPECT_DOUBLE_EQ(HeightAt(tile, 10000), -100 + 655 * (10000 / 32767.0));
}

TEST(EnclosingSphere, ContainsEveryVertex) {
  for (const geo::TileKey& key : kKeys) {
    for (HeightRange range : kRanges) {
      const QuantizedTile tile = RuggedTile(key, range);
      const std::vector<Vec3> positions = DecodePositions(tile);
      const BoundingSphere sphere = EnclosingSphere(positions);
      double farthest = 0;
      for (const Vec3& p : positions) farthest = std::max(farthest, geo::Length(p - sphere.center));
      EXPECT_LE(farthest, sphere.radius) << Describe(tile);
      EXPECT_LE(sphere.radius, farthest * (1 + 1e-9) + 1e-5) << Describe(tile);
    }
  }
}

TEST(EnclosingSphere, IsNearTheSmallest) {
  // The radius of every enclosing sphere is at least half the largest distance; the smallest one has at most 1.155
  // times that (Jung 1901).
  for (const geo::TileKey& key : kKeys) {
    const QuantizedTile tile = RuggedTile(key, {-430, 1200});
    const std::vector<Vec3> positions = DecodePositions(tile);
    double diameter = 0;
    for (const Vec3& a : positions) {
      for (const Vec3& b : positions) diameter = std::max(diameter, geo::Length(a - b));
    }
    EXPECT_LE(EnclosingSphere(positions).radius, 1.25 * diameter / 2) << Describe(tile);
  }
}

TEST(EnclosingSphere, OnePointHasAlmostNoRadius) {
  const BoundingSphere sphere = EnclosingSphere({{1000, 2000, 3000}});
  EXPECT_EQ(sphere.center, (Vec3{1000, 2000, 3000}));
  EXPECT_LT(sphere.radius, 1e-5);
}

TEST(HorizonOcclusionPoint, IsSeenWheneverAnyVertexIs) {
  for (const geo::TileKey& key : kKeys) {
    for (HeightRange range : kRanges) {
      const QuantizedTile tile = RuggedTile(key, range);
      const std::vector<Vec3> positions = DecodePositions(tile);
      const Vec3 center = EnclosingSphere(positions).center;
      const Vec3 point = HorizonOcclusionPoint(positions, center, tile.min_height);
      const double shrink = std::max(0.0, -static_cast<double>(tile.min_height));
      // For the ellipsoid, and for the one that CesiumJS shrinks to the tile's lowest vertex.
      for (double occluder_shrink : {0.0, shrink}) {
        int seen = 0, culled = 0;
        for (const Vec3& camera : CamerasAround(tile, center, 400)) {
          const Occluder occluder(camera, occluder_shrink);
          const auto visible = [&](Vec3 p) { return occluder.IsPointVisible(p); };
          if (std::none_of(positions.begin(), positions.end(), visible)) continue;
          ++seen;
          if (!occluder.IsScaledPointVisible(point)) ++culled;
        }
        EXPECT_GT(seen, 50) << Describe(tile);
        EXPECT_EQ(culled, 0) << Describe(tile) << ", ellipsoid shrunk by " << occluder_shrink;
      }
    }
  }
}

// Computes the same value from angles instead of their sines and cosines.
TEST(HorizonOcclusionPoint, LiesWhereTheOutermostTangentMeetsTheDirection) {
  for (const geo::TileKey& key : kKeys) {
    if (key.level < 1) continue;
    const QuantizedTile tile = RuggedTile(key, {100, 8800});
    const std::vector<Vec3> positions = DecodePositions(tile);
    const Vec3 center = EnclosingSphere(positions).center;
    const Occluder space(center, 0);
    const Vec3 direction = geo::Normalized(space.Scaled(center));
    double needed = 0;
    for (const Vec3& position : positions) {
      const Vec3 p = space.Scaled(position);
      const double angle = std::atan2(geo::Length(geo::Cross(p, direction)), geo::Dot(p, direction));
      needed = std::max(needed, 1 / std::cos(angle + std::acos(1 / geo::Length(p))));
    }
    const Vec3 point = HorizonOcclusionPoint(positions, center, tile.min_height);
    EXPECT_GE(geo::Length(point), needed) << Describe(tile);
    EXPECT_LE(geo::Length(point), needed * (1 + 2e-8)) << Describe(tile);
    EXPECT_NEAR(geo::Length(geo::Normalized(point) - direction), 0, 1e-15) << Describe(tile);
  }
}

TEST(HorizonOcclusionPoint, IsNeverInsideTheEllipsoid) {
  for (const geo::TileKey& key : kKeys) {
    for (HeightRange range : kRanges) {
      const QuantizedTile tile = RuggedTile(key, range);
      const std::vector<Vec3> positions = DecodePositions(tile);
      const Vec3 point = HorizonOcclusionPoint(positions, EnclosingSphere(positions).center, tile.min_height);
      EXPECT_TRUE(key.level == 0 || IsFinite(point)) << Describe(tile);
      EXPECT_TRUE(!IsFinite(point) || geo::Length(point) >= 1) << Describe(tile);
    }
  }
}

TEST(HorizonOcclusionPoint, IsNaNWhereAHemisphereHasNone) {
  for (const geo::TileKey& root : {geo::TileKey{0, 0, 0}, geo::TileKey{0, 1, 0}}) {
    const std::vector<Vec3> positions = DecodePositions(RuggedTile(root, {0, 8800}));
    const Vec3 point = HorizonOcclusionPoint(positions, EnclosingSphere(positions).center, 0);
    EXPECT_TRUE(std::isnan(point.x) && std::isnan(point.y) && std::isnan(point.z));
  }
  const std::vector<Vec3> any = DecodePositions(RuggedTile({8, 200, 130}, {0, 100}));
  EXPECT_TRUE(std::isnan(HorizonOcclusionPoint(any, {0, 0, 0}, 0).x)) << "no direction";
  EXPECT_TRUE(std::isnan(HorizonOcclusionPoint(any, any.front() * -1, 0).x)) << "the far side of the Earth";
}

}  // namespace
}  // namespace terrace::proto

#include "engine/crs/geodesic_path.h"

#include <gtest/gtest.h>

namespace terrace::dem {
namespace {

// One degree of the equator is an arc of a circle; the length on a meridian is from tables of the WGS 84 ellipsoid.
TEST(GeodesicPath, HasTheLengthOfTheEllipsoid) {
  EXPECT_NEAR(GeodesicPath({{10, 0}, {11, 0}}).length_m(), 111'319.4908, .001);
  EXPECT_NEAR(GeodesicPath({{10, 0}, {10, 1}}).length_m(), 110'574.3886, .001);
  EXPECT_NEAR(GeodesicPath({{10, 0}, {11, 0}, {10, 0}}).length_m(), 2 * 111'319.4908, .002);
  EXPECT_EQ(GeodesicPath({{10, 5}, {10, 5}}).length_m(), 0);
}

TEST(GeodesicPath, DividesAlongTheShortestLine) {
  const std::vector<PathPoint> points = GeodesicPath({{0, 50}, {60, 50}}).Divide(3);
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0].position.longitude, 0);
  EXPECT_EQ(points[2].position.longitude, 60);
  EXPECT_NEAR(points[1].position.longitude, 30, 1e-6);
  EXPECT_GT(points[1].position.latitude, 53);  // curves towards the pole
  EXPECT_NEAR(points[1].distance_m * 2, points[2].distance_m, .002);
}

TEST(GeodesicPath, CrossesTheAntimeridian) {
  const std::vector<PathPoint> points = GeodesicPath({{179, 0}, {-179, 0}}).Divide(5);
  EXPECT_NEAR(points.back().distance_m, 2 * 111'319.491, .01);
  EXPECT_NEAR(points[1].position.longitude, 179.5, 1e-6);
  EXPECT_NEAR(points[3].position.longitude, -179.5, 1e-6);
}

TEST(GeodesicPath, WalksInStepsAndEndsAtTheEnd) {
  const GeodesicPath path({{10, 0}, {11, 0}, {11, 1}});
  const std::vector<PathPoint> points = path.Walk(50'000);
  ASSERT_EQ(static_cast<double>(points.size()), path.StepCount(50'000));
  ASSERT_EQ(points.size(), 6u);  // 0, 50, 100, 150, 200 km and 221.9 km
  EXPECT_EQ(points[3].distance_m, 150'000);
  EXPECT_EQ(points[3].position.longitude, 11);  // past the corner
  EXPECT_GT(points[3].position.latitude, .3);
  EXPECT_EQ(points.back().position.latitude, 1);
  // A step as long as the path, or longer, gives both ends.
  EXPECT_EQ(path.Walk(path.length_m()).size(), 2u);
  EXPECT_EQ(path.Walk(1e9).size(), 2u);
}

TEST(GeodesicPath, WithoutLengthStaysWhereItIs) {
  const GeodesicPath path({{10, 5}, {10, 5}});
  EXPECT_EQ(path.Walk(10).size(), 2u);
  const std::vector<PathPoint> points = path.Divide(4);
  for (const PathPoint& point : points) {
    EXPECT_NEAR(point.position.longitude, 10, 1e-8);
    EXPECT_EQ(point.distance_m, 0);
  }
}

TEST(GeodesicPath, CountsStepsThatNoMemoryHolds) { EXPECT_GT(GeodesicPath({{0, 0}, {9, 0}}).StepCount(1e-300), 1e300); }

}  // namespace
}  // namespace terrace::dem

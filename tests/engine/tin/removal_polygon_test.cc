#include "engine/tin/mesh/removal_polygon.h"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace terrace::tin {
namespace {

std::vector<std::size_t> FansOf(RemovalPolygon& polygon, double max_error) {
  const auto fans = polygon.Fans(max_error);
  return {fans.begin(), fans.end()};
}

TEST(RemovalPolygon, OffersEachFanOnce) {
  RemovalPolygon polygon;
  polygon.Begin({2, 1}, 0);
  for (const SamplePosition p : {SamplePosition{0, 0}, {4, 0}, {2, 4}}) polygon.AddCorner(p, 0);
  EXPECT_EQ(FansOf(polygon, 0), (std::vector<std::size_t>{0}));
  polygon.Begin({2, 2}, 0);
  for (const SamplePosition p : {SamplePosition{0, 0}, {4, 0}, {4, 4}, {0, 4}}) polygon.AddCorner(p, 0);
  EXPECT_EQ(FansOf(polygon, 0), (std::vector<std::size_t>{0, 1}));
}

TEST(RemovalPolygon, OffersTheNearestFanFirst) {
  RemovalPolygon polygon;
  polygon.Begin({2, 2}, 10);
  // The diagonal from corner 0 has height 4 at the sample, that from corner 1 has 9.
  polygon.AddCorner({0, 0}, 4);
  polygon.AddCorner({4, 0}, 8);
  polygon.AddCorner({4, 4}, 4);
  polygon.AddCorner({0, 4}, 10);
  EXPECT_EQ(FansOf(polygon, 7), (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(FansOf(polygon, 6), (std::vector<std::size_t>{1, 0}));
  EXPECT_EQ(FansOf(polygon, 5.5), (std::vector<std::size_t>{1}));
  EXPECT_EQ(FansOf(polygon, 0.5), (std::vector<std::size_t>{}));
}

TEST(RemovalPolygon, OffersNoFanThatTurnsOver) {
  RemovalPolygon polygon;
  // A dart, reflex at corner 1: only the diagonal from there is inside.
  polygon.Begin({6, 6}, 0);
  for (const SamplePosition p : {SamplePosition{0, 8}, {5, 5}, {8, 0}, {8, 8}}) polygon.AddCorner(p, 0);
  EXPECT_EQ(FansOf(polygon, 0), (std::vector<std::size_t>{1}));
  // Three corners on one line: no triangle has them all.
  polygon.Begin({4, 1}, 0);
  for (const SamplePosition p : {SamplePosition{0, 0}, {4, 0}, {8, 0}, {4, 8}}) polygon.AddCorner(p, 0);
  EXPECT_EQ(FansOf(polygon, 0), (std::vector<std::size_t>{1}));
}

TEST(RemovalPolygon, HasNoErrorAtAVoid) {
  RemovalPolygon polygon;
  polygon.Begin({2, 1}, std::numeric_limits<double>::quiet_NaN());
  for (const SamplePosition p : {SamplePosition{0, 0}, {4, 0}, {2, 4}}) polygon.AddCorner(p, 1e30);
  EXPECT_EQ(FansOf(polygon, 0), (std::vector<std::size_t>{0}));
}

}  // namespace
}  // namespace terrace::tin

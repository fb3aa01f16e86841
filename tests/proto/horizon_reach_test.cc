// Horizons are found in vectors; what comes out is what each position gives on its own.
#include "proto/mesh/horizon_reach.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"

namespace terrace::proto {
namespace {

using geo::Vec3;

// Of one position.
double ReachOf(Vec3 position, Vec3 direction, double shrink_m) {
  const double major = geo::kSemiMajorAxis - shrink_m;
  const Vec3 p{position.x / major, position.y / major, position.z / (geo::kSemiMinorAxis - shrink_m)};
  const double length = geo::Length(p);
  const double cos_a = geo::Dot(p, direction) / length, sin_a = geo::Length(geo::Cross(p, direction)) / length;
  const double squared = std::max(1.0, length * length), cos_b = 1 / std::sqrt(squared);
  return 1 / (cos_a * cos_b - sin_a * (std::sqrt(squared - 1) * cos_b));
}

TEST(HorizonReach, IsThatOfTheFarthestPosition) {
  constexpr double kMaxReach = 100;
  std::mt19937 random(9);
  std::uniform_real_distribution<double> degrees(-0.5, 0.5), metres(-300, 5000);
  for (std::size_t count = 1; count <= 40; ++count) {
    std::vector<Vec3> positions;
    for (std::size_t i = 0; i < count; ++i) {
      positions.push_back(geo::ToEcef(8 + degrees(random), 47 + degrees(random), metres(random)));
    }
    const Vec3 direction = geo::SurfaceNormal(8, 47);
    for (const double shrink_m : {0.0, 300.0}) {
      double expected = 1;
      for (const Vec3& p : positions) expected = std::max(expected, ReachOf(p, direction, shrink_m));
      tin::ForEachInstructionSet([&] {
        double reach = 1;
        EXPECT_TRUE(RaiseReach(positions, direction, shrink_m, kMaxReach, reach));
        EXPECT_EQ(reach, expected) << count;
        // One position that has none, at any place in a vector.
        std::vector<Vec3> with_far = positions;
        with_far[count / 2] = with_far[count / 2] * -1;
        EXPECT_FALSE(RaiseReach(with_far, direction, shrink_m, kMaxReach, reach)) << count;
        with_far[count / 2] = {0, 0, 0};
        EXPECT_FALSE(RaiseReach(with_far, direction, shrink_m, kMaxReach, reach)) << count;
      });
    }
  }
}

}  // namespace
}  // namespace terrace::proto

#include "engine/tin/mesh/predicates.h"

#include <gtest/gtest.h>

#include <array>

#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

constexpr std::uint16_t kLast = (1 << 15) - 1;

TEST(Predicates, OrientationIsTwiceTheSignedArea) {
  EXPECT_EQ(Orientation({0, 0}, {1, 0}, {0, 1}), 1);
  EXPECT_EQ(Orientation({0, 0}, {0, 1}, {1, 0}), -1);
  EXPECT_EQ(Orientation({1, 1}, {3, 3}, {7, 7}), 0);
  EXPECT_EQ(Orientation({0, 0}, {kLast, 0}, {kLast, kLast}), std::int64_t{kLast} * kLast);
}

TEST(Predicates, OrientationIsAntisymmetric) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    std::array<SamplePosition, 3> p;
    for (SamplePosition& q : p)
      q = {static_cast<std::uint16_t>(random.Below(1 << 15)), static_cast<std::uint16_t>(random.Below(1 << 15))};
    EXPECT_EQ(Orientation(p[0], p[1], p[2]), Orientation(p[1], p[2], p[0]));
    EXPECT_EQ(Orientation(p[0], p[1], p[2]), -Orientation(p[1], p[0], p[2]));
  }
}

}  // namespace
}  // namespace terrace::tin

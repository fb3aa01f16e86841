#include "engine/tin/mesh/predicates.h"

#include <gtest/gtest.h>

#include <array>

#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

constexpr std::uint16_t kLast = (1 << 15) - 1;

__extension__ typedef __int128 Wide;

int Sign(Wide value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }

// The textbook determinant, in 128 bits and relative to the origin instead of d.
Wide WideInCircle(SamplePosition a, SamplePosition b, SamplePosition c, SamplePosition d) {
  const auto lifted = [](SamplePosition p) { return Wide{p.x} * p.x + Wide{p.y} * p.y; };
  const auto det3 = [&](SamplePosition p, SamplePosition q, SamplePosition r) {
    return Wide{p.x} * (Wide{q.y} * lifted(r) - lifted(q) * r.y) -
           Wide{p.y} * (Wide{q.x} * lifted(r) - lifted(q) * r.x) + lifted(p) * (Wide{q.x} * r.y - Wide{q.y} * r.x);
  };
  return -det3(b, c, d) + det3(a, c, d) - det3(a, b, d) + det3(a, b, c);
}

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

// InCircle is the reference of other tests (mesh_laws.h).
TEST(Predicates, InCircleIsZeroOnTheCircleAndPositiveInside) {
  constexpr SamplePosition a{0, 0}, b{4, 0}, c{4, 4};
  EXPECT_EQ(InCircle(a, b, c, {0, 4}), 0);
  EXPECT_GT(InCircle(a, b, c, {1, 3}), 0);
  EXPECT_LT(InCircle(a, b, c, {0, 5}), 0);
  EXPECT_GT(InCircle(b, c, a, {1, 3}), 0);
  EXPECT_GT(InCircle(c, a, b, {1, 3}), 0);
}

TEST(Predicates, InCircleIsExactForTheLargestField) {
  Random random(2);
  const auto coordinate = [&] {
    const int kind = random.Below(4);
    if (kind == 0) return std::uint16_t{0};
    if (kind == 1) return kLast;
    return static_cast<std::uint16_t>(random.Below(1 << 15));
  };
  int triangles = 0;
  for (int i = 0; i < 20000; ++i) {
    SamplePosition p[4];
    for (SamplePosition& q : p) q = {coordinate(), coordinate()};
    if (Orientation(p[0], p[1], p[2]) <= 0) continue;
    ++triangles;
    ASSERT_EQ(Sign(InCircle(p[0], p[1], p[2], p[3])), Sign(WideInCircle(p[0], p[1], p[2], p[3])));
  }
  EXPECT_GT(triangles, 5000);
}

}  // namespace
}  // namespace terrace::tin

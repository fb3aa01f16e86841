#include "proto/mesh/oct_normal.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::proto {
namespace {

using Bytes = std::array<std::uint8_t, 2>;

// The results of CesiumJS's AttributeCompression.octEncode.
TEST(OctEncode, AxesAreTheBytesOfCesium) {
  EXPECT_EQ(OctEncode({0, 0, 1}), (Bytes{128, 128}));
  EXPECT_EQ(OctEncode({0, 0, -1}), (Bytes{255, 255}));
  EXPECT_EQ(OctEncode({1, 0, 0}), (Bytes{255, 128}));
  EXPECT_EQ(OctEncode({-1, 0, 0}), (Bytes{0, 128}));
  EXPECT_EQ(OctEncode({0, 1, 0}), (Bytes{128, 255}));
  EXPECT_EQ(OctEncode({0, -1, 0}), (Bytes{128, 0}));
}

TEST(OctEncode, DecodesToWithinOneDegree) {
  double worst = 0;
  for (int i = 0; i < 20000; ++i) {  // a spiral over the whole sphere
    const double z = 1 - (2 * i + 1) / 20000.0, angle = 2.399963229728653 * i, r = std::sqrt(1 - z * z);
    const geo::Vec3 unit{r * std::cos(angle), r * std::sin(angle), z};
    const Bytes bytes = OctEncode(unit);
    const std::array<double, 3> back = DecodeOctNormal(bytes[0], bytes[1]);
    worst = std::max(worst, geo::Length(geo::Vec3{back[0], back[1], back[2]} - unit));
  }
  EXPECT_LT(worst, std::sin(geo::ToRadians(1)));
}

TEST(OctEncode, LengthDoesNotMatter) { EXPECT_EQ(OctEncode({0.3, -0.5, -0.7}), OctEncode({3, -5, -7})); }

TEST(OctEncodeDeathTest, ZeroVectorIsAMistake) { EXPECT_DEATH(OctEncode({0, 0, 0}), "check failed"); }

}  // namespace
}  // namespace terrace::proto

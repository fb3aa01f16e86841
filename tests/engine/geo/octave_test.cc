#include "engine/geo/octave.h"

#include <gtest/gtest.h>

namespace terrace::geo {
namespace {

TEST(NearestOctave, IsTheLogarithmRounded) {
  for (double value = 0x1p-30; value < 0x1p30; value *= 1.003) {
    EXPECT_EQ(NearestOctave(value), std::lround(std::log2(static_cast<long double>(value)))) << value;
  }
}

TEST(NearestOctave, TurnsAtTheRootOfTwo) {
  const double root = std::sqrt(2.0);  // rounded up
  for (int exponent = -40; exponent <= 40; ++exponent) {
    EXPECT_EQ(NearestOctave(std::ldexp(1.0, exponent)), exponent);
    EXPECT_EQ(NearestOctave(std::ldexp(root, exponent)), exponent + 1);
    EXPECT_EQ(NearestOctave(std::ldexp(std::nextafter(root, 1), exponent)), exponent);
  }
}

}  // namespace
}  // namespace terrace::geo

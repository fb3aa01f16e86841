#include "engine/geo/double_double.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <random>

namespace terrace::geo {
namespace {

using Wide = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<240>>;

Wide WideOf(DoubleDouble a) { return Wide(a.high) + Wide(a.low); }

TEST(DoubleDouble, SumsAndProductsOfDoublesAreExact) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> number(-1e6, 1e6);
  for (int i = 0; i < 10'000; ++i) {
    const double a = number(random), b = number(random) * 1e-9;
    EXPECT_EQ(WideOf(DoubleDouble::SumOf(a, b)), Wide(a) + Wide(b));
    EXPECT_EQ(WideOf(DoubleDouble::SumOf(b, a)), Wide(a) + Wide(b));
    EXPECT_EQ(WideOf(DoubleDouble::OfOrdered(a, b)), Wide(a) + Wide(b));
    EXPECT_EQ(WideOf(DoubleDouble::ProductOf(a, b)), Wide(a) * Wide(b));
  }
}

TEST(DoubleDouble, KeepsAHundredBits) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> number(-2, 2);
  const Wide unit = ldexp(Wide(1), -100);
  for (int i = 0; i < 10'000; ++i) {
    const DoubleDouble a = DoubleDouble::SumOf(number(random), number(random) * 0x1p-54);
    const DoubleDouble b = DoubleDouble::SumOf(number(random), number(random) * 0x1p-54);
    EXPECT_LE(abs(WideOf(a * b) - WideOf(a) * WideOf(b)), abs(WideOf(a) * WideOf(b)) * unit);
    EXPECT_LE(abs(WideOf(a + b) - (WideOf(a) + WideOf(b))), (abs(WideOf(a)) + abs(WideOf(b))) * unit);
    EXPECT_EQ(WideOf(a + -a), 0);
  }
}

}  // namespace
}  // namespace terrace::geo

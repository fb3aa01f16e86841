#include "engine/core/plain_number.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>

namespace terrace {
namespace {

TEST(PlainNumber, HasNoExponent) {
  EXPECT_EQ(PlainNumber(1e6), "1000000");
  EXPECT_EQ(PlainNumber(1234567.89), "1234568") << "all digits before the point";
  EXPECT_EQ(PlainNumber(1e17), "100000000000000000");
  EXPECT_EQ(PlainNumber(8.333333333e-05), "0.0000833333");
  EXPECT_EQ(PlainNumber(-2e-7), "-0.0000002");
  for (const double large : {1e300, std::numeric_limits<double>::max(), std::numeric_limits<double>::denorm_min()}) {
    EXPECT_EQ(PlainNumber(large).find('e'), std::string::npos) << large;
  }
}

TEST(PlainNumber, HasSoManySignificantDigitsAndNoZerosAtTheEnd) {
  EXPECT_EQ(PlainNumber(12.5), "12.5");
  EXPECT_EQ(PlainNumber(30), "30");
  EXPECT_EQ(PlainNumber(1.0 / 3, 3), "0.333");
  EXPECT_EQ(PlainNumber(99.96, 3), "100");
  EXPECT_EQ(PlainNumber(0), "0");
  EXPECT_EQ(PlainNumber(-0.0), "0");
  EXPECT_EQ(PlainNumber(-1e-30), "-0.000000000000000000000000000001");
  EXPECT_EQ(PlainNumber(std::nan("")), "nan");
}

TEST(PlainNumberUp, IsNeverBelow) {
  EXPECT_EQ(PlainNumberUp(12.341, 3), "12.4");
  EXPECT_EQ(PlainNumberUp(12.3, 3), "12.3");
  EXPECT_EQ(PlainNumberUp(0.0009961, 3), "0.000997");
  EXPECT_EQ(PlainNumberUp(9.999, 3), "10");
  EXPECT_EQ(PlainNumberUp(1234.5, 3), "1235");
  for (double value = 1e-6; value < 1e9; value *= 1.0937) {
    const double printed = std::strtod(PlainNumberUp(value, 3).c_str(), nullptr);
    EXPECT_GE(printed, value);
    EXPECT_LE(printed, std::max(value * 1.01, value + 1));
  }
}

}  // namespace
}  // namespace terrace

#include "proto/format_error_up.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

namespace terrace::proto {
namespace {

TEST(ErrorText, PrintsErrorsRoundedUp) {
  EXPECT_EQ(FormatErrorUp(0), "0");
  EXPECT_EQ(FormatErrorUp(3.87), "3.87");
  EXPECT_EQ(FormatErrorUp(3.871234), "3.87124");
  EXPECT_EQ(FormatErrorUp(3.8712399), "3.87124");
  EXPECT_EQ(FormatErrorUp(999999.4), "1e+06");
  EXPECT_EQ(FormatErrorUp(38533.671), "38533.7");
}

TEST(ErrorText, NeverPrintsLessThanTheError) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> exponent(-12, 12);
  for (int i = 0; i < 20'000; ++i) {
    const double error_m = std::pow(10, exponent(random));
    const double printed = std::strtod(FormatErrorUp(error_m).c_str(), nullptr);
    EXPECT_GE(printed, error_m);
    EXPECT_LE(printed, error_m * (1 + 1.001e-5));
  }
}

}  // namespace
}  // namespace terrace::proto

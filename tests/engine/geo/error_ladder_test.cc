#include "engine/geo/error_ladder.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <string>

#include "engine/geo/tile_key.h"

namespace terrace::geo {
namespace {

TEST(ErrorLadder, StartsAtTheErrorClientsAssume) {
  EXPECT_NEAR(LevelError(0), 77067.34, 0.005);
  EXPECT_NEAR(DefaultError(0), 38533.67, 0.005);
  EXPECT_EQ(DefaultError(9), DefaultError(0) / 512);
  EXPECT_EQ(DefaultError(3, 0.25), DefaultError(4));
}

TEST(ErrorLadder, HasFortyOneStepsAQuarterOctaveApart) {
  EXPECT_EQ(kFinestStep - kCoarsestStep + 1, 41);
  EXPECT_EQ(LadderError(5, 0), DefaultError(5));
  EXPECT_EQ(LadderError(5, kCoarsestStep), 16 * DefaultError(5));
  EXPECT_EQ(LadderError(5, kFinestStep), DefaultError(5) / 64);
  for (int step = kCoarsestStep; step <= kFinestStep; ++step) {
    EXPECT_NEAR(LadderError(7, step) / (DefaultError(7) * std::pow(2.0, -step / 4.0)), 1, 1e-14);
  }
}

TEST(ErrorLadder, SnapsDownAndClamps) {
  const double d = DefaultError(10);
  EXPECT_EQ(SnapToLadder(10, d), 0);
  EXPECT_EQ(SnapToLadder(10, d * 1.18), 0);
  EXPECT_EQ(SnapToLadder(10, d * 1.19), -1);
  EXPECT_EQ(SnapToLadder(10, d * 0.999), 1);
  EXPECT_EQ(SnapToLadder(10, 1e300), kCoarsestStep);
  EXPECT_EQ(SnapToLadder(10, 1e-300), kFinestStep);
  for (double error = d / 60; error < d * 15; error *= 1.01) {
    const int step = SnapToLadder(10, error);
    EXPECT_LE(LadderError(10, step), error * (1 + 1e-9));
    EXPECT_GT(LadderError(10, step - 1), error);
  }
}

TEST(ErrorLadder, APrintedLadderValueFindsItself) {
  for (int level = 0; level <= kMaxLevel; ++level) {
    for (int step = kCoarsestStep; step <= kFinestStep; ++step) {
      for (const double fraction : {0.5, 0.3}) {
        const std::string printed = fmt::format("{:.10g}", LadderError(level, step, fraction));
        ASSERT_EQ(SnapToLadder(level, std::strtod(printed.c_str(), nullptr), fraction), step)
            << level << ' ' << printed;
      }
    }
  }
}

TEST(ErrorLadderDeathTest, RefusesErrorsWithoutMeaning) {
  EXPECT_DEATH(SnapToLadder(0, 0), "check failed");
  EXPECT_DEATH(SnapToLadder(0, std::nan("")), "check failed");
  EXPECT_DEATH(LadderError(0, kFinestStep + 1), "check failed");
}

}  // namespace
}  // namespace terrace::geo

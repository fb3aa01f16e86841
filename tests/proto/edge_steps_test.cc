#include "proto/mesh/edge_steps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace terrace::proto {
namespace {

using Needs = std::array<std::array<double, 3>, 3>;

bool IsPowerOfTwo(double value) { return std::ldexp(1.0, std::ilogb(value)) == value; }

TEST(NeededStep, LeavesHalfOfTheFormatForRounding) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> height(-11000, 9000);
  for (int run = 0; run < 10000; ++run) {
    const double a = height(random), b = height(random);
    const double step = NeededStep(std::min(a, b), std::max(a, b));
    EXPECT_TRUE(IsPowerOfTwo(step));
    EXPECT_LE(std::abs(a - b), 16384 * step);
    EXPECT_GE(step, kHeightResolution);
  }
  EXPECT_EQ(NeededStep(5, 5), kHeightResolution);
}

// This rule prevents cracks: both tiles of an edge, and all four tiles of a corner, derive the same step.
TEST(EdgeSteps, AgreeBetweenNeighbours) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> relief(0, 9000);
  for (int run = 0; run < 1000; ++run) {
    std::array<std::array<double, 4>, 4> needed;  // a block of 4 x 4 tiles, row 0 in the south
    for (auto& row : needed) {
      for (double& step : row) step = NeededStep(0, relief(random));
    }
    const double error = std::exp2(std::uniform_real_distribution<double>(-4, 12)(random));
    const auto steps_of = [&](std::size_t row, std::size_t column) {
      Needs window{};
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) window[r][c] = needed[row - 1 + r][column - 1 + c];
      }
      return MakeEdgeSteps(EdgeErrors(error), window, 1, false, false);
    };
    const EdgeSteps sw = steps_of(1, 1), se = steps_of(1, 2), nw = steps_of(2, 1), ne = steps_of(2, 2);
    EXPECT_EQ(sw.side[1], se.side[3]);
    EXPECT_EQ(sw.side[2], nw.side[0]);
    EXPECT_EQ(ne.side[3], nw.side[1]);
    EXPECT_EQ(ne.side[0], se.side[2]);
    EXPECT_EQ(sw.corner[2], se.corner[3]);
    EXPECT_EQ(sw.corner[2], ne.corner[0]);
    EXPECT_EQ(sw.corner[2], nw.corner[1]);
    for (const double step : sw.side) {
      EXPECT_GE(step, needed[1][1]);
      EXPECT_TRUE(IsPowerOfTwo(step));
    }
  }
}

TEST(EdgeSteps, PutAPoleOnOneGrid) {
  Needs needed{};
  for (auto& row : needed) row = {0.25, 0.5, 1.0};
  const EdgeSteps steps = MakeEdgeSteps(EdgeErrors(1), needed, 4, true, false);
  EXPECT_EQ(steps.side[0], 4);
  EXPECT_EQ(steps.corner[0], 4);
  EXPECT_EQ(steps.corner[1], 4);
  EXPECT_EQ(steps.side[2], 0.5);
}

TEST(EdgeSteps, CoarsestCountsBothCorners) {
  EdgeSteps steps;
  steps.side = {1, 1, 1, 1};
  steps.corner = {8, 2, 1, 4};
  EXPECT_EQ(steps.Coarsest(tin::Side::kSouth), 8);
  EXPECT_EQ(steps.Coarsest(tin::Side::kEast), 2);
  EXPECT_EQ(steps.Coarsest(tin::Side::kNorth), 4);
  EXPECT_EQ(steps.Coarsest(tin::Side::kWest), 8);
}

TEST(SnapHeight, GoesToTheNearestMultipleAndHalvesGoUp) {
  EXPECT_EQ(SnapHeight(1.3, 0.5), 1.5);
  EXPECT_EQ(SnapHeight(1.25, 0.5), 1.5);
  EXPECT_EQ(SnapHeight(-1.25, 0.5), -1);
}

}  // namespace
}  // namespace terrace::proto

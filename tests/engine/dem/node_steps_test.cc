// Steps between positions are measured in vectors; what comes out is what each node gives on its own.
#include "engine/bound/node_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <vector>

#include "engine/crs/node_positions.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

struct Measured {
  NodeSteps steps;
  PixelBounds at;
  bool is_known = false;

  auto Values() const {
    return std::tuple(steps.east_x, steps.east_y, steps.north_x, steps.north_y, steps.bend_x, steps.bend_y, at.west,
                      at.east, at.north, at.south);
  }
};

// Node by node.
Measured Expected(const Position* southwest, std::ptrdiff_t stride, int columns, int rows) {
  Measured one;
  double sum = 0;
  const auto axis = [&](double Position::*of, double& east, double& north, double& bend) {
    for (int j = 0; j <= rows; ++j) {
      for (int i = 0; i <= columns; ++i) {
        const Position* const p = southwest + j * stride + i;
        const double here = p->*of, to_east = p[1].*of - here, to_west = here - p[-1].*of;
        const double to_north = p[stride].*of - here, to_south = here - p[-stride].*of;
        sum += to_east + to_west + to_north + to_south;
        if (i < columns) east = std::max(east, std::abs(to_east));
        if (j < rows) north = std::max(north, std::abs(to_north));
        bend = std::max({bend, std::abs(to_east - to_west), std::abs(to_north - to_south)});
      }
    }
  };
  axis(&Position::x, one.steps.east_x, one.steps.north_x, one.steps.bend_x);
  axis(&Position::y, one.steps.east_y, one.steps.north_y, one.steps.bend_y);
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) one.at.Add(southwest[j * stride + i].x, southwest[j * stride + i].y);
  }
  one.is_known = std::isfinite(sum);
  return one;
}

TEST(NodeSteps, AreThoseOfSingleNodes) {
  constexpr std::size_t kStride = 21;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> off(-0.2, 0.2);
  int known = 0, unknown = 0;
  for (int round = 0; round < 400; ++round) {
    std::vector<Position> nodes(kStride * kStride);
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      nodes[n] = {100 + 0.8 * static_cast<double>(n % kStride) + off(random),
                  300 - 0.7 * static_cast<double>(n / kStride) + off(random)};
    }
    const auto pick = [&](int count) { return static_cast<int>(random() % static_cast<unsigned>(count)); };
    if (round % 2 == 0) nodes[random() % nodes.size()] = kNowhere;
    const int columns = 1 + pick(16), rows = 1 + pick(16);
    const std::size_t first = kStride * (1 + random() % 3) + 1 + random() % 3;
    const Measured expected = Expected(&nodes[first], kStride, columns, rows);
    (expected.is_known ? known : unknown) += 1;
    tin::ForEachInstructionSet([&] {
      Measured one;
      one.is_known = MeasureSteps(&nodes[first], kStride, columns, rows, one.steps, one.at);
      ASSERT_EQ(one.is_known, expected.is_known) << round;
      if (one.is_known) {
        ASSERT_EQ(one.Values(), expected.Values()) << round;
      }
    });
  }
  EXPECT_GT(known, 200);
  EXPECT_GT(unknown, 30);
}

}  // namespace
}  // namespace terrace::dem

// Steps between places are measured in vectors; what comes out is what each node gives on its own.
#include "engine/bound/node_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <tuple>
#include <vector>

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
Measured Expected(const NodeCoordinates& places, int columns, int rows) {
  Measured one;
  double sum = 0;
  const auto axis = [&](const double* place, double& east, double& north, double& bend) {
    const auto stride = static_cast<std::ptrdiff_t>(places.stride);
    for (int j = 0; j <= rows; ++j) {
      for (int i = 0; i <= columns; ++i) {
        const double* const p = place + j * stride + i;
        const double to_east = p[1] - *p, to_west = *p - p[-1], to_north = p[stride] - *p, to_south = *p - p[-stride];
        sum += to_east + to_west + to_north + to_south;
        if (i < columns) east = std::max(east, std::abs(to_east));
        if (j < rows) north = std::max(north, std::abs(to_north));
        bend = std::max({bend, std::abs(to_east - to_west), std::abs(to_north - to_south)});
      }
    }
  };
  axis(places.x, one.steps.east_x, one.steps.north_x, one.steps.bend_x);
  axis(places.y, one.steps.east_y, one.steps.north_y, one.steps.bend_y);
  for (int j = 0; j <= rows; ++j) {
    for (int i = 0; i <= columns; ++i) {
      const std::size_t n = static_cast<std::size_t>(j) * places.stride + static_cast<std::size_t>(i);
      one.at.Add(places.x[n], places.y[n]);
    }
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
    std::vector<double> x(kStride * kStride), y(x.size());
    for (std::size_t n = 0; n < x.size(); ++n) {
      x[n] = 100 + 0.8 * static_cast<double>(n % kStride) + off(random);
      y[n] = 300 - 0.7 * static_cast<double>(n / kStride) + off(random);
    }
    const auto pick = [&](int count) { return static_cast<int>(random() % static_cast<unsigned>(count)); };
    if (round % 2 == 0) {
      const std::size_t n = random() % x.size();
      x[n] = y[n] = std::numeric_limits<double>::quiet_NaN();
    }
    const int columns = 1 + pick(16), rows = 1 + pick(16);
    const std::size_t first = kStride * (1 + random() % 3) + 1 + random() % 3;
    const NodeCoordinates places{x.data() + first, y.data() + first, kStride};
    const Measured expected = Expected(places, columns, rows);
    (expected.is_known ? known : unknown) += 1;
    tin::ForEachInstructionSet([&] {
      Measured one;
      one.is_known = MeasureSteps(places, columns, rows, one.steps, one.at);
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

// Errors of rows are measured in vectors; what comes out is what each node gives on its own.
#include "proto/error/row_error.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"

namespace terrace::proto {
namespace {

TEST(RowError, IsThatOfTheWorstNode) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> metres(-50, 50), share(-1, 1);
  for (std::size_t count = 1; count <= 40; ++count) {
    std::vector<float> samples;
    std::vector<geo::SinCos> columns;
    for (std::size_t i = 0; i < count; ++i) {
      samples.push_back(static_cast<float>(metres(random)));
      const double angle = 0.3 + 1e-5 * static_cast<double>(i);
      columns.push_back({std::sin(angle), std::cos(angle)});
    }
    const LinearRow linear{metres(random), share(random), metres(random), 32767, metres(random)};
    const PlumbRow plumb{share(random), share(random), 0.7, share(random), 6.3e6 * share(random), 4.5e6};
    double of_linear = 0, of_plumb = 0, least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < count; ++i) {
      const double height =
          linear.origin + linear.slope * (linear.x + linear.unit * static_cast<double>(i)) + linear.rise;
      of_linear = std::max(of_linear, std::abs(height - samples[i]));
      const double across = columns[i].cos * plumb.x + columns[i].sin * plumb.y, up = plumb.cos * across + plumb.north;
      of_plumb = std::max(of_plumb, std::abs((plumb.rest - plumb.radius * across) / up - samples[i]));
      least = std::min(least, std::abs(up));
    }
    tin::ForEachInstructionSet([&] {
      EXPECT_EQ(LargestOfLinearRow(linear, samples.data(), count), of_linear) << count;
      const auto [lowest, highest] = ExtentOf(samples);
      EXPECT_EQ(lowest, std::ranges::min(samples));
      EXPECT_EQ(highest, std::ranges::max(samples));
      double steepest = 0;
      EXPECT_EQ(LargestOfPlumbRow(plumb, columns.data(), samples.data(), count, steepest), of_plumb) << count;
      EXPECT_EQ(steepest, least) << count;
    });
  }
}

}  // namespace
}  // namespace terrace::proto

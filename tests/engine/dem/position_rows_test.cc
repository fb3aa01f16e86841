// Rows of positions are computed in vectors; the results are those of each position on its own.
#include "engine/crs/position_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <tuple>
#include <vector>

#include "engine/crs/node_positions.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

TEST(PositionRows, AreSumsOfWeightedKnots) {
  tin::ForEachInstructionSet([] {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> place(-50, 2000), share(-0.5, 1.5);
    for (std::size_t count = 0; count < 40; ++count) {
      std::array<Position, kKnots> knots;
      std::array<std::vector<double>, kKnots> weights;
      std::array<const double*, kKnots> first;
      for (std::size_t i = 0; i < knots.size(); ++i) {
        knots[i] = {place(random), place(random)};
        for (std::size_t k = 0; k < count; ++k) weights[i].push_back(share(random));
        first[i] = weights[i].data();
      }
      std::vector<Position> positions(count + 1, {7, 8});
      InterpolatePositions(knots, first, std::span(positions).first(count));
      for (std::size_t k = 0; k < count; ++k) {
        Position sum;
        for (std::size_t i = 0; i < knots.size(); ++i) {
          sum.x += weights[i][k] * knots[i].x;
          sum.y += weights[i][k] * knots[i].y;
        }
        ASSERT_EQ(std::pair(positions[k].x, positions[k].y), std::pair(sum.x, sum.y)) << k << " of " << count;
      }
      ASSERT_EQ(std::pair(positions.back().x, positions.back().y), std::pair(7.0, 8.0)) << "beyond the end";
    }
  });
}

TEST(PositionRows, ExtentLeavesUnknownPositionsOut) {
  tin::ForEachInstructionSet([] {
    std::mt19937 random(9);
    std::uniform_real_distribution<double> place(-50, 2000);
    for (std::size_t count = 1; count < 40; ++count) {
      for (const unsigned share : {0U, 4U, 1U}) {  // one in so many is unknown; 0: none
        std::vector<Position> positions(count);
        PositionExtent expected;
        for (Position& p : positions) {
          p = {place(random), place(random)};
          if (share != 0 && random() % share == 0) {
            p = kNowhere;
            expected.are_all_known = false;
            continue;
          }
          expected.min = {std::min(expected.min.x, p.x), std::min(expected.min.y, p.y)};
          expected.max = {std::max(expected.max.x, p.x), std::max(expected.max.y, p.y)};
        }
        const PositionExtent extent = ExtentOf(positions);
        ASSERT_EQ(std::tuple(extent.min.x, extent.min.y, extent.max.x, extent.max.y, extent.are_all_known),
                  std::tuple(expected.min.x, expected.min.y, expected.max.x, expected.max.y, expected.are_all_known));
      }
    }
  });
}

}  // namespace
}  // namespace terrace::dem

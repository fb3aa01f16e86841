// Rows of positions are computed in vectors; the results are those of each position on its own.
#include "engine/crs/position_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <span>
#include <tuple>
#include <vector>

#include "engine/crs/node_positions.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

PositionExtent OneByOne(std::span<const Position> positions) {
  PositionExtent extent;
  for (const Position& p : positions) {
    if (std::isnan(p.x)) {
      extent.are_all_known = false;
      continue;
    }
    extent.min = {std::min(extent.min.x, p.x), std::min(extent.min.y, p.y)};
    extent.max = {std::max(extent.max.x, p.x), std::max(extent.max.y, p.y)};
  }
  return extent;
}

void ExpectSame(const PositionExtent& a, const PositionExtent& b) {
  EXPECT_EQ(std::tuple(a.min.x, a.min.y, a.max.x, a.max.y, a.are_all_known),
            std::tuple(b.min.x, b.min.y, b.max.x, b.max.y, b.are_all_known));
}

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
      const PositionExtent extent = InterpolatePositions(knots, first, std::span(positions).first(count));
      ExpectSame(extent, OneByOne(std::span(positions).first(count)));
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
        for (Position& p : positions) {
          p = share != 0 && random() % share == 0 ? kNowhere : Position{place(random), place(random)};
        }
        ExpectSame(ExtentOf(positions), OneByOne(positions));
      }
    }
  });
}

// Whole numbers, so that many positions lie on the edge of the box.
TEST(PositionRows, InsideABoxIncludesItsEdge) {
  tin::ForEachInstructionSet([] {
    std::mt19937 random(10);
    std::size_t on_edge = 0;
    for (std::size_t count = 0; count < 40; ++count) {
      std::vector<Position> positions(count);
      for (Position& p : positions) {
        p = {static_cast<double>(random() % 6), static_cast<double>(random() % 6)};
        if (random() % 5 == 0) p = kNowhere;
      }
      std::vector<std::uint8_t> inside(count + 1, 0);
      inside.back() = 9;
      for (std::size_t k = 0; k < count; k += 7) inside[k] = 1;
      MarkInside(positions, {1, 2}, {4, 3}, std::span(inside).first(count));
      for (std::size_t k = 0; k < count; ++k) {
        const Position& p = positions[k];
        const bool is_inside = p.x >= 1 && p.x <= 4 && p.y >= 2 && p.y <= 3;
        ASSERT_EQ(inside[k], is_inside || k % 7 == 0 ? 1 : 0) << k << " of " << count;
        on_edge += inside[k] != 0 && (p.x == 1 || p.x == 4) ? 1U : 0U;
      }
      ASSERT_EQ(inside.back(), 9) << "beyond the end";
    }
    ASSERT_GT(on_edge, 20U);
  });
}

}  // namespace
}  // namespace terrace::dem

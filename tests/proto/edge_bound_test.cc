// The bound of an edge is never below the largest difference from the lattice surface along it, nor far above.
#include "proto/error/edge_bound.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/engine/tin/instruction_sets.h"

namespace terrace::proto {
namespace {

double SurfaceAt(const TileSamples& samples, double x, double y) {
  const int i = std::clamp(static_cast<int>(x), 0, samples.cells() - 1);
  const int j = std::clamp(static_cast<int>(y), 0, samples.cells() - 1);
  const double south = samples.At(i, j) + (x - i) * (double{samples.At(i + 1, j)} - samples.At(i, j));
  const double north = samples.At(i, j + 1) + (x - i) * (double{samples.At(i + 1, j + 1)} - samples.At(i, j + 1));
  return south + (y - j) * (north - south);
}

// By many points of the edge.
double LargestAlong(const TileSamples& samples, const EdgeBound::End& a, const EdgeBound::End& b) {
  constexpr int kPoints = 3000;
  double largest = 0;
  for (int k = 0; k <= kPoints; ++k) {
    const double t = static_cast<double>(k) / kPoints;
    const double x = a.place.x + t * (b.place.x - a.place.x), y = a.place.y + t * (b.place.y - a.place.y);
    largest = std::max(largest, std::abs(a.height + t * (b.height - a.height) - SurfaceAt(samples, x, y)));
  }
  return largest;
}

TEST(EdgeBound, IsAboveEveryPointOfTheEdge) {
  constexpr int kCells = 32;
  std::mt19937 random(8);
  const auto pick = [&](int count) { return static_cast<int>(random() % static_cast<unsigned>(count)); };
  std::vector<float> heights(static_cast<std::size_t>((kCells + 3) * (kCells + 3)));
  for (float& height : heights) height = static_cast<float>(500 + pick(40 << 10) / 1024.0);
  const TileSamples samples{{10, 5, 5}, {10, kCells}, heights};
  double east = 0, north = 0;
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i) {
      if (i < kCells) east = std::max(east, std::abs(double{samples.At(i + 1, j)} - samples.At(i, j)));
      if (j < kCells) north = std::max(north, std::abs(double{samples.At(i, j + 1)} - samples.At(i, j)));
    }
  }
  tin::ForEachInstructionSet([&] {
    const EdgeBound bound(samples);
    EXPECT_EQ(bound.steepest_east(), east);
    EXPECT_EQ(bound.steepest_north(), north);
    double sum = 0;
    constexpr int kEdges = 600;
    for (int round = 0; round < kEdges; ++round) {
      // At nodes, near them as positions of 15 bits are, and anywhere.
      const auto coordinate = [&](double node) {
        const double at = round % 3 == 0   ? node
                          : round % 3 == 1 ? std::round(node * 1023.97) / 1023.97
                                           : node + pick(1000) / 1000.0;
        return std::clamp(at, 0.0, double{kCells});
      };
      const auto end = [&] {
        const LatticePoint place{coordinate(pick(kCells + 1)), coordinate(pick(kCells + 1))};
        return bound.EndAt(place, SurfaceAt(samples, place.x, place.y) + pick(100) / 100.0);
      };
      const EdgeBound::End a = end(), b = end();
      const double largest = LargestAlong(samples, a, b), over = bound.Over(a, b);
      ASSERT_GE(over, largest) << a.place.x << ' ' << a.place.y << " - " << b.place.x << ' ' << b.place.y;
      if (largest > 0) sum += over / largest;
    }
    EXPECT_LT(sum / kEdges, 1.6);
  });
}

}  // namespace
}  // namespace terrace::proto

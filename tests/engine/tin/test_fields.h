// Height fields for tests of the mesher.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

inline constexpr float kVoid = std::numeric_limits<float>::quiet_NaN();

// A small random number generator with the same numbers in every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15u + 1) {}
  std::uint64_t Next();
  int Below(int bound) { return static_cast<int>(Next() % static_cast<std::uint64_t>(bound)); }
  double Unit() { return static_cast<double>(Next() >> 11) * 0x1p-53; }

 private:
  std::uint64_t state_;
};

// Three samples that turn counter-clockwise, with their heights.
std::array<Corner, 3> RandomTriangle(Random& random, const HeightField& field);

HeightField MakeField(int width, int height, const std::function<float(int x, int y)>& at);

// Independent heights in [0, 100).
HeightField NoiseField(int width, int height, std::uint64_t seed);

// Whole metres in 0..range-1: many samples tie.
HeightField StepField(int width, int height, int range, std::uint64_t seed);

// Octaves of value noise: hills a few hundred metres high.
float HillHeight(int x, int y, std::uint64_t seed);
HeightField HillField(int width, int height, std::uint64_t seed);

}  // namespace terrace::tin

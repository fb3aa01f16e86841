#include "tests/engine/tin/test_fields.h"

#include <utility>
#include <vector>

#include "engine/core/check.h"

namespace terrace::tin {

std::uint64_t Random::Next() {
  // SplitMix64.
  std::uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

std::array<Corner, 3> RandomTriangle(Random& random, const HeightField& field) {
  while (true) {
    std::array<Corner, 3> corners;
    for (Corner& corner : corners) {
      corner.x = random.Below(field.width());
      corner.y = random.Below(field.height());
      corner.z = static_cast<double>(field.VertexHeight(corner.x, corner.y));
    }
    const auto& [a, b, c] = corners;
    if ((b.x - a.x) * (c.y - a.y) > (b.y - a.y) * (c.x - a.x)) return corners;
  }
}

HeightField MakeField(int width, int height, const std::function<float(int x, int y)>& at) {
  std::vector<float> heights;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) heights.push_back(at(x, y));
  }
  Result<HeightField> field = HeightField::Make(width, height, std::move(heights));
  TERRACE_CHECK(field.has_value());
  return *std::move(field);
}

HeightField NoiseField(int width, int height, std::uint64_t seed) {
  Random random(seed);
  return MakeField(width, height, [&](int, int) { return static_cast<float>(random.Unit() * 100); });
}

HeightField StepField(int width, int height, int range, std::uint64_t seed) {
  Random random(seed);
  return MakeField(width, height, [&](int, int) { return static_cast<float>(random.Below(range)); });
}

float HillHeight(int x, int y, std::uint64_t seed) {
  const auto node = [&](int column, int row, int octave) {
    Random random(seed * 1000003 + static_cast<std::uint64_t>(column) * 7919 +
                  static_cast<std::uint64_t>(row) * 104729 + static_cast<std::uint64_t>(octave));
    return random.Unit();
  };
  double height = 0;
  for (int octave = 0; octave < 5; ++octave) {
    const int cell = 32 >> octave;
    const int column = x / cell, row = y / cell;
    const double u = static_cast<double>(x % cell) / cell, v = static_cast<double>(y % cell) / cell;
    const double south = node(column, row, octave) * (1 - u) + node(column + 1, row, octave) * u;
    const double north = node(column, row + 1, octave) * (1 - u) + node(column + 1, row + 1, octave) * u;
    height += cell * 8 * (south * (1 - v) + north * v);
  }
  return static_cast<float>(height);
}

HeightField HillField(int width, int height, std::uint64_t seed) {
  return MakeField(width, height, [&](int x, int y) { return HillHeight(x, y, seed); });
}

}  // namespace terrace::tin

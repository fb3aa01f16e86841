#include "proto/mesh/oct_normal.h"

#include <algorithm>
#include <cmath>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

double SignNotZero(double value) { return value < 0 ? -1 : 1; }

// -1..1 to 0..255, halves upwards as JavaScript's Math.round does. The sum is positive, so the cast is its floor.
std::uint8_t ToByte(double value) {
  return static_cast<std::uint8_t>(static_cast<int>((std::clamp(value, -1.0, 1.0) * 0.5 + 0.5) * 255 + 0.5));
}

}  // namespace

std::array<std::uint8_t, 2> OctEncode(geo::Vec3 unit) {
  const double sum = std::abs(unit.x) + std::abs(unit.y) + std::abs(unit.z);
  TERRACE_CHECK(std::isfinite(sum) && sum > 0);
  double x = unit.x / sum;
  double y = unit.y / sum;
  if (unit.z < 0) {  // the lower half folds outwards, over the square's corners
    const double folded_x = (1 - std::abs(y)) * SignNotZero(x);
    y = (1 - std::abs(x)) * SignNotZero(y);
    x = folded_x;
  }
  return {ToByte(x), ToByte(y)};
}

}  // namespace terrace::proto

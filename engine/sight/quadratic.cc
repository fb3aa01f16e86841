#include "engine/sight/quadratic.h"

#include <algorithm>

namespace terrace::dem {

Quadratic::Range Quadratic::Over(double first, double last) const {
  const double at_first = At(first), at_last = At(last);
  Range range{std::min(at_first, at_last), std::max(at_first, at_last)};
  if (Slope(first) * Slope(last) < 0) {
    const double value = At(-b_ / (2 * a_));
    range = {std::min(range.min, value), std::max(range.max, value)};
  }
  return range;
}

double Quadratic::Solve(double value, double first, double last) const {
  const double at_first = At(first), at_last = At(last);
  double s = at_last == at_first ? first : first + (value - at_first) / (at_last - at_first) * (last - first);
  for (int step = 0; step < 2; ++step) {
    const double slope = Slope(s);
    if (slope != 0) s -= (At(s) - value) / slope;
  }
  return std::clamp(s, first, last);
}

}  // namespace terrace::dem

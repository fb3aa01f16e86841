// Nearest powers of two, without the C library's logarithms, whose last bits may differ between processors.
#pragma once

#include <cmath>

namespace terrace::geo {

// Returns the integer nearest to the binary logarithm of `value`. Precondition: positive and finite.
inline int NearestOctave(double value) {
  int exponent = 0;
  const double fraction = std::frexp(value, &exponent);  // 0.5 .. 1, exact
  return fraction * fraction < 0.5 ? exponent - 1 : exponent;
}

}  // namespace terrace::geo

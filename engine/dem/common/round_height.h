// Rounds heights to multiples of 2^-10 m.
#pragma once

#include <cmath>

namespace terrace::dem {

// Rounds to the nearest multiple of 2^-10 m, ties to even. This removes the last bits of libm's results, which differ
// between processors. Precondition: |metres| < 2^42.
inline float RoundHeight(double metres) {
  // Like std::nearbyint, but without a call, so that compilers can vectorize loops: at 2^52 a double has no fraction
  // bits.
  constexpr double kNoFraction = 0x1p52;
  const double scaled = metres * 1024;
  return static_cast<float>(std::copysign((std::abs(scaled) + kNoFraction) - kNoFraction, scaled) / 1024);
}

}  // namespace terrace::dem

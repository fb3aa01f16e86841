// The grid of heights.
#pragma once

#include <cmath>

namespace terrace::dem {

// Heights are multiples of 2^-10 m: libm's last bits, which differ between processors, end here. Halves go to the even
// multiple. Precondition: below 2^42 m.
inline float RoundHeight(double metres) {
  // std::nearbyint without a call, so that loops become vectors: at 2^52 a double has no bits below one.
  constexpr double kNoFraction = 0x1p52;
  const double scaled = metres * 1024;
  return static_cast<float>(std::copysign((std::abs(scaled) + kNoFraction) - kNoFraction, scaled) / 1024);
}

}  // namespace terrace::dem

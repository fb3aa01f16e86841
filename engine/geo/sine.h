// Sine and cosine with the same bits on every processor. Results of the C library differ in the last bit between
// processors with and without fused multiply-add.
#pragma once

namespace terrace::geo {

struct SinCos {
  double sin = 0, cos = 1;
};

// Rounded to the nearest multiple of 2^-44 (0.4 micrometres on the ground). At multiples of 30 degrees, a sine or
// cosine that is a multiple of one half is exact. Takes about 30 ns: compute it once for positions on the same meridian
// or parallel. Precondition: |degrees| <= 2^20.
SinCos RoundedSinCos(double degrees);

}  // namespace terrace::geo

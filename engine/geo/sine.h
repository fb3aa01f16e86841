// Sine and cosine with the same bits on every processor. Those of the C library differ in the last bit between
// processors that have fused multiply-add and those that have not.
#pragma once

namespace terrace::geo {

struct SinCos {
  double sin = 0, cos = 1;
};

// Rounded to the nearest multiple of 2^-44 (0.4 micrometres on the ground); exact at multiples of 30 and 90 degrees
// that have exact ones. Precondition: |degrees| <= 2^20. What has many positions on few meridians and parallels finds
// them out once: it takes some 30 ns.
SinCos RoundedSinCos(double degrees);

}  // namespace terrace::geo

// The worst sample beneath or above a chord: the loop of WorstBorderSample (border.h), in vectors.
#pragma once

#include <cstddef>

#include "engine/tin/greedy.h"

namespace terrace::tin {

// A border edge along its axis, and the samples beside it.
struct Chord {
  int a = 0, b = 0;                // where it begins and ends; a < b
  double h_a = 0, h_b = 0;         // heights of the ends, metres
  const float* heights = nullptr;  // the sample at a, metres; NaN is void
  std::ptrdiff_t stride = 1;       // from one sample to the next
};

struct ChordMisfit {
  double error = 0;  // by the rule of BorderOptions; 0: no sample is off
  int at = 0;        // where; the first of equals
};

// Of the samples strictly between the ends. With k the position of a sample, each is judged in double as
//   |(h_a (b - k) + h_b (k - a)) / (b - a) - h| + sagitta_m (k - a) (b - k)
// in exactly this form, without fused operations: the same on every processor, bit for bit.
//
// Safe to call from many threads at once.
ChordMisfit WorstOfChord(const Chord& chord, const BorderOptions& options);

}  // namespace terrace::tin

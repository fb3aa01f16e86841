// The sample of a border edge with the largest error: the vectorized loop of WorstBorderSample (border.h).
#pragma once

#include "engine/tin/greedy.h"

namespace terrace::tin {

// A border edge along its axis, and the samples beside it. Precondition: (b - a) stride < 2^31, as in any HeightField.
struct Chord {
  int a = 0, b = 0;                // where it begins and ends; a < b
  double h_a = 0, h_b = 0;         // heights of the ends, metres
  const float* heights = nullptr;  // the sample at a, metres; NaN is void
  int stride = 1;                  // from one sample to the next
};

struct ChordMisfit {
  double error = 0;  // 0: no sample is off
  int at = 0;        // the sample with this error; the first of equals
};

// The worst sample strictly between the ends by the rule of BorderOptions, in exactly its form and without fused
// operations. Other samples are not read. The result is bit-equal on every processor.
//
// Safe to call from many threads at once.
ChordMisfit WorstOfChord(const Chord& chord, const BorderOptions& options);

}  // namespace terrace::tin

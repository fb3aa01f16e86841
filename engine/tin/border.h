// One-dimensional simplification of a field's borders: the error of samples between two neighbouring border vertices.
//
// Everything here depends on the samples and vertices of one border alone (BorderOptions in greedy.h states the rule),
// so that two fields that share a border choose the same vertices on it. Safe to call from many threads at once.
#pragma once

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// The side that both corners lie on. Precondition: they are different and on one border.
Side SideOf(const HeightField& field, const Corner& a, const Corner& b);

// A border edge along its axis, and the samples on it. Precondition: (b - a) stride < 2^31, as in any HeightField.
struct Chord {
  int a = 0, b = 0;                // first and last sample; a < b
  double h_a = 0, h_b = 0;         // heights of the ends, metres
  const float* heights = nullptr;  // the sample at a, metres; NaN is void
  int stride = 1;                  // from one sample to the next
};

struct ChordMisfit {
  double error = 0;  // 0: no sample is off
  int at = 0;        // the sample with this error; the first of equals
};

// The sample strictly between the ends with the largest error by the rule of BorderOptions. The formula is evaluated as
// it is written there, without fused operations: the result is bit-equal on every processor. Reads no other samples.
ChordMisfit WorstOfChord(const Chord& chord, const BorderOptions& options);

// The worst valid sample strictly between two neighbouring border vertices, given in any order, by the rule of
// BorderOptions.
Candidate WorstBorderSample(const HeightField& field, const Corner& a, const Corner& b, const BorderOptions& options);

// The same with errors as SampleLimits::WeightedError weights them. A cap applies to the error before
// BorderOptions::scale.
Candidate WorstLimitedBorderSample(const HeightField& field, const Corner& a, const Corner& b,
                                   const BorderOptions& options, const SampleLimits& limits);

// Sum of the squared vertical distances of the same samples from the chord, without weight and sagitta.
double SquaredBorderDistances(const HeightField& field, const Corner& a, const Corner& b);

}  // namespace terrace::tin

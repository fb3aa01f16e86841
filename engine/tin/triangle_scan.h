// The worst sample of one triangle: the inner loop of greedy insertion.
//
// "Its samples" are those of ForEachInnerSpan: the closed triangle without its corners and without the field's border,
// which is judged by a rule of its own (border.h). Voids are skipped. The result is a function of the field and the
// three corners, in any order. Safe to call from many threads at once.
#pragma once

#include <array>
#include <cstdint>

#include "engine/tin/candidate.h"
#include "engine/tin/height_field.h"
#include "engine/tin/plane.h"

namespace terrace::tin {

struct PlaneMisfit {
  double distance = -1;              // vertical, metres; negative: the triangle has no samples
  std::uint32_t sample = kNoSample;  // row-major index; the smallest of equally distant samples
};

// The sample that is furthest from the plane through the corners.
PlaneMisfit WorstSample(const HeightField& field, const std::array<Corner, 3>& corners);

// Sum of the squared vertical distances of its samples. Those on an edge count one half: their other half is in the
// triangle across.
double SquaredDistances(const HeightField& field, const std::array<Corner, 3>& corners);

}  // namespace terrace::tin

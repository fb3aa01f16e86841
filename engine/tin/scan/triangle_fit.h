// Tests whether a triangle is within a bound of its samples: the inner loop of the drop pass.
#pragma once

#include <array>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// Whether no valid sample of the triangle is more than `bound` metres from its plane, vertically. The samples are those
// of ForEachInnerSpan: of the closed triangle, without its corners and the field's border. A negative bound asks
// whether there are no valid samples. Corners in any order, not on one line. Safe to call from many threads at once.
bool SamplesAreWithin(const HeightField& field, const std::array<Corner, 3>& corners, double bound);

}  // namespace terrace::tin

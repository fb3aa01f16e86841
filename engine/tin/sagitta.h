// How far a flat triangle cuts below curved ground: the bound that Curvature in greedy.h states.
#pragma once

#include <array>

#include "engine/tin/greedy.h"
#include "engine/tin/plane.h"

namespace terrace::tin {

// Metres; 0 for flat ground. Corners in any order, not on one line.
double SagittaBound(const Curvature& curvature, const std::array<Corner, 3>& corners);

}  // namespace terrace::tin

// The first sample of a triangle: the result of its scan if all samples lie on its plane.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/star.h"

namespace terrace::tin {

// Number of the first sample of the star's triangle i that a scan looks at (triangle_scan.h); kNoSample if
// there is none.
std::uint32_t FirstSample(const HeightField& field, const Star& star, std::size_t i);

}  // namespace terrace::tin

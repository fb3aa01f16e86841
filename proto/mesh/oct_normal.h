// Unit vectors in two bytes: the oct encoding of the octvertexnormals extension.
//
// Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors" (JCGT 2014): the unit octahedron
// |x| + |y| + |z| = 1, unfolded onto a square; each coordinate is rounded to 0..255, which stand for -1..1. This is
// CesiumJS's AttributeCompression.octEncode, whose decoder is in every client. The worst error is about 1 degree.
#pragma once

#include <array>
#include <cstdint>

#include "engine/geo/ellipsoid.h"

namespace terrace::proto {

// Depends on `unit` alone, so that neighbouring tiles that agree on a normal agree on its bytes.
// Precondition: not the zero vector, and finite.
std::array<std::uint8_t, 2> OctEncode(geo::Vec3 unit);

}  // namespace terrace::proto

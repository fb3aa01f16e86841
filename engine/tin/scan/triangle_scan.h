// The worst sample of each triangle of a star: the inner loop of greedy insertion.
//
// The samples of a triangle are those inside it and on its edges that may still become vertices. Corners, voids and
// samples on the field's border are excluded; the border has its own rule (border.h). Let p be the triangle's last
// corner, u and v the other two relative to p, D twice its area, A = v_y dz_u - u_y dz_v and B = u_x dz_v - v_x dz_u.
// The distance of a sample is
//   |D (h - z_p) - (A (x - x_p) + B (y - y_p))| / D
// in double in exactly this form, without steps and fused operations. Single precision and integers are used where they
// give the same result. The result is bit-equal on every processor, whatever its vectors; Highway chooses the widest at
// run time. Float heights stay far from overflow (2^128 * 2^32).
//
// Safe to call from many threads at once.
#pragma once

#include <bit>
#include <cstdint>

#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/star.h"

namespace terrace::tin {

struct PlaneMisfit {
  double distance = -1;              // vertical, metres; negative: the triangle has no samples
  std::uint32_t sample = kNoSample;  // its number; the smallest of equally distant samples
};

// The distance, or 0 if there are no samples. Computed from the sign: a maximum would become a branch that is
// mispredicted.
inline double DistanceOrZero(const PlaneMisfit& misfit) {
  const auto bits = std::bit_cast<std::int64_t>(misfit.distance);
  return std::bit_cast<double>(bits & ~(bits >> 63));
}

// Sets misfits[i] for each triangle i of the star. Values of triangles that are left out are undefined. Precondition:
// vertices have the heights of the field's samples, or any height at voids.
using StarScan = void (*)(const HeightField& field, const Star& star, PlaneMisfit* misfits);

// The scan for this processor.
StarScan BestStarScan();

}  // namespace terrace::tin

// The worst sample of each triangle of a star: the inner loop of greedy insertion.
//
// A triangle's samples are those in its inside and on its edges that may still become vertices: neither its corners,
// besides which a triangle has no vertices, nor voids, nor the field's border, which is judged by a rule of its own
// (border.h). With p the triangle's last corner, u and v the others relative to it, D twice its area,
// A = v_y dz_u - u_y dz_v and B = u_x dz_v - v_x dz_u, the distance of a sample is
//   |D (h - z_p) - (A (x - x_p) + B (y - y_p))| / D
// in double in exactly this form, never stepped, without fused operations, or in single precision or integers where
// those are known to give the same numbers. The result is the same on every processor, bit for bit, whatever vectors it
// has; Highway picks the widest at run time. Floats as heights stay far from overflow (2^128 * 2^32).
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

// Its distance, or 0 where there are no samples. By its sign: a maximum becomes a branch, and whether a triangle has
// samples cannot be predicted.
inline double DistanceOrZero(const PlaneMisfit& misfit) {
  const auto bits = std::bit_cast<std::int64_t>(misfit.distance);
  return std::bit_cast<double>(bits & ~(bits >> 63));
}

// misfits[i] is that of triangle i of the star; of one that is left out it is anything. Precondition: vertices have the
// heights of the field, or any where that is void.
using StarScan = void (*)(const HeightField& field, const Star& star, PlaneMisfit* misfits);

// The scan for this processor.
StarScan BestStarScan();

}  // namespace terrace::tin

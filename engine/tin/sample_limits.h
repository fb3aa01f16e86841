// Limits of the error that differ from sample to sample: precision by place, and features that are inserted first.
//
// Garland and Heckbert, "Fast Triangular Approximation of Terrains and Height Fields" (1997), section 5. An error e of
// a sample counts as
//   weight e           up to the cap,
//   weight e 2^34      above the cap, so it comes before all errors below 2^34 times the smallest cap,
//   max(e, 1) 2^40     if the sample is forced, whatever its error is.
// None of this depends on the goal of a run, so coarser meshes stay prefixes of finer ones. A mesh to the error E has
// e <= min(E / weight, cap) at every sample, and all forced samples as vertices.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"

namespace terrace::tin {

// All members have a value for each sample, row by row, or are empty.
struct SampleLimits {
  std::vector<float> weights;        // at least 1
  std::vector<float> caps;           // metres, above 0; infinite: none. As many as `weights`
  std::vector<std::uint8_t> forced;  // 1: a vertex of every mesh

  bool empty() const { return weights.empty() && forced.empty(); }

  bool HasLimit(std::size_t sample) const {
    return !weights.empty() && (weights[sample] > 1 || caps[sample] < std::numeric_limits<float>::infinity());
  }

  // The error of a sample, weighted as defined above. `scale`: factor on the caps; from 1024 on, forced samples count
  // like others. A run that exceeds a limit of vertices is repeated with a larger scale.
  double WeightedError(std::size_t sample, double error, double scale = 1) const {
    constexpr double kBeyondCap = 0x1p34, kForced = 0x1p40, kGiveUp = 1024;
    if (!forced.empty() && forced[sample] != 0 && scale < kGiveUp) return std::max(error, 1.0) * kForced;
    if (weights.empty()) return error;
    const double weighted = error * static_cast<double>(weights[sample]);
    return error > scale * static_cast<double>(caps[sample]) ? weighted * kBeyondCap : weighted;
  }

  // The largest error that a run to `error` leaves at a sample.
  double Allowed(std::size_t sample, double error) const {
    if (weights.empty()) return error;
    return std::min(error / static_cast<double>(weights[sample]), static_cast<double>(caps[sample]));
  }
};

// The smallest box that contains the samples added; empty at first.
struct BoundingBox {
  int west = std::numeric_limits<int>::max(), south = west, east = -1, north = -1;

  void Add(int x, int y) {
    west = std::min(west, x), east = std::max(east, x);
    south = std::min(south, y), north = std::max(north, y);
  }
};

// The samples that have a limit (HasLimit) or are forced.
BoundingBox BoxOfLimits(const SampleLimits& limits, int width, int height);

// The worst sample of a closed triangle, by SampleLimits::WeightedError, without its corners and without the field's
// border. `sagitta_m` is added to distances. Safe to call from many threads at once.
Candidate WorstLimited(const HeightField& field, const std::array<Corner, 3>& corners, double sagitta_m,
                       const SampleLimits& limits, double scale);

// SamplesAreWithin (scan/triangle_spans.h) with the bound Allowed(sample, max_error). `sagitta_m` is added to
// distances.
bool SamplesAreAllowed(const HeightField& field, const std::array<Corner, 3>& corners, double sagitta_m,
                       const SampleLimits& limits, double max_error);

}  // namespace terrace::tin

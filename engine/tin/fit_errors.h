// The misfit between triangles and samples, by the measures of data-dependent triangulation: Garland and Heckbert
// (1997), section 3.4.1. In metres; in square metres for FitMeasure::kSumSquares. FitMeasure::kNormals does not use
// this class (quadrilateral.h).
//
// Not thread-safe; different objects are independent.
#pragma once

#include <algorithm>
#include <cstddef>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/mesh/triangulation.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/scan/triangle_scan.h"

namespace terrace::tin {

class FitErrors {
 public:
  // Elements beyond the star's triangles that the arrays of `Scan` must have.
  static constexpr std::size_t kPadding = 8;

  // The field and the sagitta must outlive this object.
  FitErrors(const HeightField& field, const Sagitta& sagitta, FitMeasure measure);

  // Whether the misfit of a triangle is its largest distance, which scans find.
  bool are_maxima() const { return measure_ == FitMeasure::kSumMax || measure_ == FitMeasure::kMaxMax; }

  // The squared misfit of two triangles, in square metres for every measure.
  double CombinedSquare(double a, double b) const {
    if (measure_ == FitMeasure::kSumSquares) return a + b;
    const double combined = measure_ == FitMeasure::kMaxMax ? std::max(a, b) : a + b;
    return combined * combined;
  }

  // The result of a StarScan, and the misfits if are_maxima(). Values of triangles that are left out are undefined.
  void Scan(const Star& star, PlaneMisfit* misfits, double* errors) const {
    scan_star_(*field_, star, misfits);
    if (star.has_border || !sagitta_->is_flat()) [[unlikely]]
      return AddBordersAndSagitta(star, misfits, errors);
    // Blocks of eight: branches on the number of triangles would be mispredicted.
    for (std::size_t i = 0; i < star.count; i += kPadding) {
#pragma GCC unroll 8
      for (std::size_t k = i; k < i + kPadding; ++k) errors[k] = DistanceOrZero(misfits[k]);
    }
  }

  // The misfit of the triangle (u, v, p), u and v relative to p. Bit-equal to its misfit as a part of a star of p.
  double Of(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v);

  // The same if are_maxima(), from the result of a scan.
  double Of(const PlaneMisfit& misfit, const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v) const;

 private:
  void AddBordersAndSagitta(const Star& star, const PlaneMisfit* misfits, double* errors) const;
  double WorstOnBorders(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v) const;
  bool IsInside(SamplePosition sample) const;

  const HeightField* field_;
  const Sagitta* sagitta_;
  FitMeasure measure_;
  StarScan scan_star_ = BestStarScan();
  Star lone_star_;  // of one triangle
};

}  // namespace terrace::tin

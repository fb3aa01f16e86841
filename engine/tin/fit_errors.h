// How badly triangles fit the samples, by the measures that data-dependent triangulation compares them by: Garland and
// Heckbert (1997), section 3.4.1. Metres, or square metres by FitMeasure::kSumSquares. The angle between normals needs
// none of this (quadrilateral.h).
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
  // Values that arrays for `Scan` must have beyond those of the star.
  static constexpr std::size_t kPadding = 8;

  // The field and the sagitta must outlive this object.
  FitErrors(const HeightField& field, const Sagitta& sagitta, FitMeasure measure);

  // By the largest distance of a triangle, which scans find.
  bool are_maxima() const { return measure_ == FitMeasure::kSumMax || measure_ == FitMeasure::kMaxMax; }

  // Of two triangles, squared: square metres by every measure.
  double CombinedSquare(double a, double b) const {
    if (measure_ == FitMeasure::kSumSquares) return a + b;
    const double combined = measure_ == FitMeasure::kMaxMax ? std::max(a, b) : a + b;
    return combined * combined;
  }

  // What a StarScan finds, and errors by maxima: of a triangle that is left out, anything.
  void Scan(const Star& star, PlaneMisfit* misfits, double* errors) const {
    scan_star_(*field_, star, misfits);
    if (star.has_border || !sagitta_->is_flat()) [[unlikely]]
      return AddBordersAndSagitta(star, misfits, errors);
    // Eight together, since how many there are cannot be predicted.
    for (std::size_t i = 0; i < star.count; i += kPadding) {
#pragma GCC unroll 8
      for (std::size_t k = i; k < i + kPadding; ++k) errors[k] = DistanceOrZero(misfits[k]);
    }
  }

  // Of one triangle (u, v, p), u and v seen from p; equal bit for bit to what is found of it as part of a star of p.
  double Of(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v);

  // By maxima, from what a scan has found.
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

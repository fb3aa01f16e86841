// Data-dependent triangulation: which triangles an inserted vertex replaces, by how well they fit the samples.
//
// Garland and Heckbert (1997), section 3.4. Around a new vertex p, an edge (u, v) of the cavity's outline is suspect:
// the quadrilateral (p, u, w, v) with the triangle beyond it is cut by u-v or by p-w, whichever fits better, and the
// edges that take its place are suspect in turn. Spokes (edges at p) are not. Each test is a function of its
// quadrilateral alone, so that the cavity does not depend on the order of the tests, on the triangle that the insertion
// starts from, or on slots.
//
// Scanned once: a triangle that was scanned for a test and ends up in the star is not scanned for its candidate again.
// The test is lazy: first the shape, then the two samples whose errors are known to be largest, and the new triangles
// only where p-w can still fit better. The outcome is that of the full test.
//
// Whatever is chosen here, candidates are the exact worst samples of the final triangles: the bound is kept as with any
// other criterion.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/height_field.h"
#include "engine/tin/quadrilateral.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/spare_blocks.h"
#include "engine/tin/star.h"
#include "engine/tin/triangle_scan.h"
#include "engine/tin/triangulation.h"

namespace terrace::tin {

class DataDependentCriterion {
 public:
  // What it works on belongs to the run and must outlive this object.
  DataDependentCriterion(const HeightField& field, const Sagitta& sagitta, Triangulation& triangulation,
                         DataDependentOptions options);

  // Triangulation::Insert by this criterion.
  const Star& Insert(const Triangulation::Vertex& vertex, TriangleId triangle);

  // What a StarScan finds, for the star of the last insertion or a triangle as a star of its own. Valid until the next
  // call of anything.
  const PlaneMisfit* Scan(const Star& star);

 private:
  static constexpr double kUnknown = -1;
  static constexpr std::size_t kLikelyEdges = 64;  // of an outline
  static constexpr std::size_t kMostFitted = 4;    // triangles at once

  // How well a triangle fits that has its last corner at p.
  struct Fit {
    double error = kUnknown;  // by the measure
    double distance = -1;     // of the sample that is furthest off, as PlaneMisfit has it; with maxima only
    std::uint32_t worst = kNoSample;
  };
  using FitId = std::uint32_t;
  static constexpr FitId kUnknownFit = 0;

  // What is remembered of a triangle, by slot.
  struct KnownFit {
    double error = kUnknown;
    std::uint32_t worst = kNoSample;  // the sample that is furthest off
    float worst_height = 0;           // beside it: a test need not fetch it from the field
  };

  bool UsesMaxima() const { return options_.measure == FitMeasure::kSumMax || options_.measure == FitMeasure::kMaxMax; }
  double Combine(double a, double b) const { return options_.measure == FitMeasure::kMaxMax ? std::max(a, b) : a + b; }

  void Begin(TriangleId triangle);
  bool Absorbs(const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back, WalkPlace place);
  void Keep(WalkPlace place);
  void End(const Star& star);
  bool IsBetterAlongPw(const Quadrilateral& q, TriangleId beyond, FitId& uv, FitId& halves);
  void RaiseLeastErrors(const Quadrilateral& q, std::uint32_t sample, float height, std::array<double, 2>& least) const;
  KnownFit FitBeyond(TriangleId t);
  KnownFit Remembered(const Fit& fit) const;
  template <std::size_t kVertices>
  FitId FitAround(const Triangulation::Vertex& p, const std::array<RingVertex, kVertices>& ring);
  Fit FitOf(const PlaneMisfit& misfit, SamplePosition p, float p_height, const RingVertex& u,
            const RingVertex& v) const;
  double WorstOnBorders(SamplePosition p, float p_height, const RingVertex& u, const RingVertex& v) const;
  bool IsInside(int x, int y) const;
  void MakeRoom(const Star& star);
  void CoverSlots();

  const HeightField* field_;
  const Sagitta* sagitta_;
  Triangulation* triangulation_;
  DataDependentOptions options_;
  StarScan scan_star_ = BestStarScan();

  LargeArray<KnownFit> known_;  // by slot

  // Of the insertion at work.
  Triangulation::Vertex vertex_;
  std::vector<Fit> fits_ = std::vector<Fit>(4 * kLikelyEdges);  // the first one is unknown
  std::uint32_t fit_count_ = 1;
  std::vector<FitId> pending_ = std::vector<FitId>(kLikelyEdges);  // by WalkPlace::pending, from 1 on
  std::array<FitId, 2> split_;                                     // beyond the edge that the vertex lies on
  std::vector<FitId> kept_ = pending_;                             // by edge of the outline

  // Of the last star.
  VertexId centre_ = 0;
  std::size_t count_ = 0;
  std::vector<PlaneMisfit> misfits_;
  Star scratch_;
};

}  // namespace terrace::tin

// Data-dependent triangulation: which triangles an inserted vertex replaces, by how well they fit the samples.
//
//        w           Garland and Heckbert (1997), section 3.4. Around a new vertex p, an edge (u, v) of the cavity's
//       / \          outline is suspect: the quadrilateral (p, u, w, v) with the triangle beyond it is cut by u-v or by
//      /   \         p-w. If by p-w, u-w and w-v take the place of u-v, and are suspect in turn. Spokes (edges at p)
//      are not.
//     u-----v
//      \   /         With S the squared quality of a cut's shape (quadrilateral.h), E how badly it fits, q = qthresh:
//        p               p-w is taken if S(u-v) < q^2 S(p-w),
//                        u-v is kept if S(p-w) < q^(5/4) S(u-v), at edges further out if S(p-w) < q^(1/4) S(u-v),
//                        else the cut with less E^2 / S is taken; if equal, the better shape; if equal too, p-w.
// Edges that have come into the outline in place of other ones are further out.
// With FitMeasure::kNormals, S is squared once more, and the thresholds do not depend on how the edge came into the
// outline. With q = 0 the fit alone decides, as in the paper. The paper compares E alone and has one threshold. Taking
// p-w where it makes the shape worse rarely saves vertices in the end, and costs two more scans of triangles.
// Therefore u-v is kept more readily than p-w is taken, and most readily at edges further out from p: there are three
// thresholds. All of this
// together saves 3 to 6 % of the vertices (docs/decisions/0007).
//
// A test depends on its quadrilateral, on which corner of the triangle beyond the edge was inserted last (misfits are
// computed relative to it, so their rounding depends on it), and on how its edge came into the outline. The cavity
// therefore does not depend on the order of the tests, on the triangle that the insertion starts from, or on slots.
//
// Tests can therefore be done in groups. The walk around p absorbs the triangles that the shape decides on. One scan
// then measures the triangles of the outline it has found, and both triangles of the other cut wherever the fit
// decides. The edges that come into the outline are tested in the next round. Starting a scan costs more than its
// triangles do, and what a scan finds for the final triangles is reused: they are scanned once.
//
// Candidates are the exact worst samples of the final triangles, whatever is chosen here: the error bound holds as with
// any other criterion.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/quadrilateral.h"
#include "engine/tin/mesh/spare_blocks.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/mesh/triangulation.h"
#include "engine/tin/sagitta.h"
#include "engine/tin/scan/triangle_scan.h"

namespace terrace::tin {

// The misfit between triangles and samples, by the measures of data-dependent triangulation: Garland and Heckbert
// (1997), section 3.4.1. In metres; in square metres for FitMeasure::kSumSquares. FitMeasure::kNormals does not use
// this class (quadrilateral.h).
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

  // `worst`: the result of a StarScan. `misfits`: those of the triangles, only if are_maxima(). Values of triangles
  // that are left out are undefined.
  void Scan(const Star& star, PlaneMisfit* worst, double* misfits) const {
    scan_star_(*field_, star, worst);
    if (star.has_border || !sagitta_->is_flat()) [[unlikely]]
      return AddBordersAndSagitta(star, worst, misfits);
    // Blocks of eight: branches on the number of triangles would be mispredicted.
    for (std::size_t i = 0; i < star.count; i += kPadding) {
#pragma GCC unroll 8
      for (std::size_t k = i; k < i + kPadding; ++k) misfits[k] = DistanceOrZero(worst[k]);
    }
  }

  // The misfit of the triangle (u, v, p), u and v relative to p. Bit-equal to its misfit as a part of a star of p.
  double Of(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v);

  // The same if are_maxima(), from the result of a scan.
  double Of(const PlaneMisfit& misfit, const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v) const;

 private:
  void AddBordersAndSagitta(const Star& star, const PlaneMisfit* worst, double* misfits) const;
  double WorstOnBorders(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v) const;
  bool IsInside(SamplePosition sample) const;

  const HeightField* field_;
  const Sagitta* sagitta_;
  FitMeasure measure_;
  StarScan scan_star_ = BestStarScan();
  Star lone_star_;  // of one triangle
};

class DataDependentCriterion {
 public:
  // The arguments belong to the run and must outlive this object.
  DataDependentCriterion(const HeightField& field, const Sagitta& sagitta, Triangulation& triangulation,
                         DataDependentOptions options);

  // Triangulation::Insert by this criterion. The vertex is passed by value, in registers: the caller has just written
  // it field by field, and a load of the whole vertex would stall.
  const Star& Insert(Triangulation::Vertex vertex, TriangleId triangle);

  // The same result as a StarScan of the last insertion's star, or of a single triangle given as a star. Valid until
  // the next call.
  const PlaneMisfit* Scan(const Star& star);

 private:
  static constexpr double kUnknown = -1;
  static constexpr std::size_t kLikelyEdges = 64;  // of an outline
  static constexpr std::size_t kSpareSlots = std::size_t{1} << 10;
  static constexpr std::size_t kMaxPairs = (Star::kMaxLeftOut + 1) / 3;  // in a scan without other triangles
  // Star::left_out of such a scan. A pair is the two triangles beside the edge p-w of a suspect; the triangle between
  // two pairs is left out.
  static constexpr std::uint32_t kBetweenPairs = 0b100'100'100'100'100'100'100'100'100'100;

  // The fit of a triangle that has p as a corner.
  struct Fit {
    PlaneMisfit misfit;  // only if FitErrors::are_maxima()
    double error = kUnknown;
  };

  // An edge whose quadrilateral may be cut the other way.
  struct Suspect {
    std::uint32_t edge = 0;  // by its place in the outline
    HalfEdgeId outside = 0;
    bool is_certain = false;  // its shape alone decides for p-w
    ShapeQuality quality;
    Triangulation::Beyond beyond;
  };

  // A suspect edge that is cut the other way: u-w and w-v replace it. The pointers refer to the arrays of the round
  // that decided it. These arrays do not change until the edges are replaced: `suspects_` is swapped before it is
  // written to again, and no scan runs in between.
  struct Flip {
    const Suspect* suspect = nullptr;
    const PlaneMisfit* misfits = nullptr;  // of (u, w, p) and (w, v, p)
    const double* errors = nullptr;
  };

  // An edge of an outline that is being changed, from its u to the u of the next edge. Edges are linked in order.
  struct Edge {
    RingVertex u;
    HalfEdgeId outside = 0;
    std::uint32_t next = 0;
    Fit fit;
  };

  struct Ends {
    RingVertex u, v;
  };

  Star& OutlineByShape(const Triangulation::Vertex& vertex, TriangleId triangle);
  ShapeQuality QualityOf(const Quadrilateral& q) const;
  bool IsBetterAlongPw(double now, double then, const ShapeQuality& quality) const;
  void FitOutline(Star& star);
  void FitSuspects(const Star& star, std::size_t first);
  void FitOneByOne(const Star& star, std::size_t index);
  std::size_t PutPair(Star& star, std::size_t end, const Ends& ends, const Triangulation::Beyond& beyond) const;
  void Decide(const Suspect& suspect, const PlaneMisfit* misfits, const double* errors);
  void ReplaceEdges(Star& star);
  void ReplaceEdge(Star& star, const Flip& flip);
  void SuspectEdge(Star& star, std::uint32_t index);
  Ends EndsOf(const Star& star, std::uint32_t edge) const;
  // The misfits of the triangle of p and an edge of the outline, and of a triangle beyond the outline.
  double& NearError(std::uint32_t edge) { return edge_count_ == 0 ? errors_[edge] : edges_[edge].fit.error; }
  double ErrorBeyond(TriangleId t);
  void PrefetchError(TriangleId t) const;
  void MakeRoom(const Star& star);
  void MakeRoomForPairs();
  void CoverSlots();

  Triangulation* triangulation_;
  DataDependentOptions options_;
  // Thresholds on the ratio of the squared shape qualities of the two cuts: below them the shape decides.
  double taken_below_, kept_below_, kept_further_out_below_;
  FitErrors fit_errors_;
  LargeArray<double> errors_by_slot_;

  // State of the current insertion.
  Triangulation::Vertex vertex_;
  std::vector<Suspect> suspects_ = std::vector<Suspect>(kLikelyEdges), decided_ = suspects_;
  std::vector<Flip> flips_ = std::vector<Flip>(kLikelyEdges);
  std::vector<Edge> edges_ = std::vector<Edge>(kLikelyEdges);
  std::size_t suspect_count_ = 0, flip_count_ = 0;
  std::size_t edge_count_ = 0;  // 0 as long as the outline is the star's
  Star pairs_;
  std::vector<PlaneMisfit> pair_misfits_ = std::vector<PlaneMisfit>(3 * kMaxPairs + FitErrors::kPadding);
  std::vector<double> pair_errors_ = std::vector<double>(3 * kMaxPairs + FitErrors::kPadding);

  // State of the last star.
  VertexId centre_ = 0;
  std::size_t count_ = 0;
  std::vector<PlaneMisfit> misfits_;
  std::vector<double> errors_;
};

}  // namespace terrace::tin

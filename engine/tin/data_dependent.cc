#include "engine/tin/data_dependent.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/border.h"
#include "engine/tin/plane.h"
#include "engine/tin/squared_distances.h"

namespace terrace::tin {
namespace {

SamplePosition PositionAround(SamplePosition p, const RingVertex& vertex) {
  return {static_cast<std::uint16_t>(p.x + vertex.dx), static_cast<std::uint16_t>(p.y + vertex.dy)};
}

Corner CornerAt(SamplePosition position, float height) { return {position.x, position.y, static_cast<double>(height)}; }

// An edge with both ends on one border is on that border.
bool IsBorderEdge(const HeightField& field, SamplePosition a, SamplePosition b) {
  return (a.x == b.x && (a.x == 0 || a.x == field.width() - 1)) ||
         (a.y == b.y && (a.y == 0 || a.y == field.height() - 1));
}

// How far a sample is from the triangle (u, v, p), in the form of the scan: equal bit for bit. x and y are relative to
// p.
double DistanceFrom(const RingVertex& u, const RingVertex& v, float p_height, int x, int y, float height) {
  const double ux = u.dx, uy = u.dy, vx = v.dx, vy = v.dy, pz = static_cast<double>(p_height);
  const double uz = static_cast<double>(u.height) - pz, vz = static_cast<double>(v.height) - pz;
  const double d = ux * vy - uy * vx, a = vy * uz - uy * vz, b = ux * vz - vx * uz;
  return std::abs(d * (static_cast<double>(height) - pz) - (a * x + b * y)) / d;
}

}  // namespace

DataDependentCriterion::DataDependentCriterion(const HeightField& field, const Sagitta& sagitta,
                                               Triangulation& triangulation, DataDependentOptions options)
    : field_(&field), sagitta_(&sagitta), triangulation_(&triangulation), options_(options) {
  TERRACE_CHECK(options_.qthresh >= 0 && options_.qthresh <= 1);
}

const Star& DataDependentCriterion::Insert(const Triangulation::Vertex& vertex, TriangleId triangle) {
  vertex_ = vertex;
  Begin(triangle);
  const Star& star = triangulation_->Insert(
      vertex, triangle, [this](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back) {
        return Absorbs(u, v, w, back);
      });
  End(star);
  return star;
}

// The edges of the triangle are the first to be suspect, and most of them stay: fitted together. Where the vertex lies
// on one of them, those of the triangle beyond take its place.
void DataDependentCriterion::Begin(TriangleId triangle) {
  pending_.clear();
  kept_.clear();
  CoverSlots();
  if (!UsesMaxima()) return;
  const auto seen = [&](VertexId corner) { return triangulation_->Seen(corner, vertex_.position); };
  const auto [a, b, c] = triangulation_->triangle(triangle);
  const std::array<RingVertex, 4> corners = {seen(a), seen(b), seen(c), seen(a)};
  std::array<RingVertex, kMostFirstEdges + 1> ring;
  std::size_t edges = 0;
  for (std::uint32_t i = 0; i < 3; ++i) {
    const HalfEdgeId back = triangulation_->twin(4 * triangle + i);
    if (back != kNoEdge) __builtin_prefetch(&known_[back / 4]);
    TERRACE_CHECK(edges < kMostFirstEdges);
    ring[edges++] = corners[i];
    if (Cross(corners[i], corners[i + 1]) > 0) continue;
    TERRACE_CHECK(edges < kMostFirstEdges);  // on two edges: a corner
    if (back == kNoEdge) return;             // on the border
    ring[edges++] = seen(triangulation_->corner(Triangulation::Previous(back)));
  }
  ring[edges] = ring[0];
  std::array<Fit, kMostFirstEdges> fits;
  FitAround(vertex_, ring.data(), edges, fits.data());
  pending_.assign(std::make_reverse_iterator(fits.begin() + edges), fits.rend());
}

bool DataDependentCriterion::Absorbs(const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back) {
  if (Cross(u, v) == 0) return true;
  Fit uv = TakePending(u.id), uw, wv;
  const bool absorbs = Sees(u, v, w) && IsBetterAlongPw({u, v, w, vertex_.height}, back / 4, uv, uw, wv);
  if (absorbs) {
    // Known or not: whatever is asked for next has its place.
    wv.u = w.id;
    uw.u = u.id;
    pending_.push_back(wv);
    pending_.push_back(uw);
  } else if (uv.error != kUnknown) {
    kept_.push_back(uv);
  }
  return absorbs;
}

// The outline is walked in order, like a stack, and each of its edges that may be asked for has an entry, but for the
// first ones of an insertion. So what lies above the edge asked for was on the border and stays, and an outline leaves
// each vertex once: entries are told apart by that one.
DataDependentCriterion::Fit DataDependentCriterion::TakePending(VertexId u) {
  while (!pending_.empty()) {
    const Fit top = pending_.back();
    pending_.pop_back();
    if (top.u == u) return top;
    kept_.push_back(top);
  }
  return {};
}

// Sets the fits that it had to find out. Equal fits, frequent where heights are whole metres: the better shape.
bool DataDependentCriterion::IsBetterAlongPw(const Quadrilateral& q, TriangleId beyond, Fit& uv, Fit& uw, Fit& wv) {
  const ShapeQuality quality = ShapeQualityOf(q);
  const bool is_shaped_better = quality.pw > quality.uv;
  const auto fit_new = [&] {
    std::array<Fit, 2> fits;
    const std::array<RingVertex, 3> ring = {q.u, q.w, q.v};
    FitAround(vertex_, ring.data(), 2, fits.data());
    uw = fits[0];
    wv = fits[1];
  };
  if (std::min(quality.uv, quality.pw) <= options_.qthresh * std::max(quality.uv, quality.pw)) {
    if (is_shaped_better && UsesMaxima()) fit_new();  // most of them stay: fitted together
    return is_shaped_better;
  }
  if (options_.measure == FitMeasure::kNormals) return BendsLessAlongPw(q);

  const KnownFit known = FitBeyond(beyond);
  if (uv.error == kUnknown) FitAround(vertex_, std::array{q.u, q.v}.data(), 1, &uv);
  const double error = Combine(uv.error, known.error);
  if (error == 0) return false;
  const auto wins = [&](double of_uw, double of_wv) {
    const double other = Combine(of_uw, of_wv);
    return is_shaped_better ? other <= error : other < error;
  };
  if (UsesMaxima()) {
    double least_uw = 0, least_wv = 0;
    if (known.worst != kNoSample) RaiseLeastErrors(q, known.worst, known.worst_height, least_uw, least_wv);
    if (uv.worst != kNoSample) RaiseLeastErrors(q, uv.worst, field_->At(PositionOf(uv.worst)), least_uw, least_wv);
    if (!wins(least_uw, least_wv)) return false;
  }
  fit_new();
  return wins(uw.error, wv.error);
}

// A sample of the quadrilateral is in one of the new triangles: that one is off by no less than there. Rounding
// does not matter, since maxima and sums of what is not negative are monotonic as computed.
void DataDependentCriterion::RaiseLeastErrors(const Quadrilateral& q, std::uint32_t sample, float height, double& uw,
                                              double& wv) const {
  const SamplePosition position = PositionOf(sample);
  const int x = position.x - vertex_.position.x, y = position.y - vertex_.position.y;
  const std::int32_t side = Cross(q.w, RingVertex{0, x, y, height});
  if (side <= 0) uw = std::max(uw, DistanceFrom(q.u, q.w, vertex_.height, x, y, height));
  if (side >= 0) wv = std::max(wv, DistanceFrom(q.w, q.v, vertex_.height, x, y, height));
}

DataDependentCriterion::KnownFit DataDependentCriterion::Remembered(const Fit& fit) const {
  return {fit.error, fit.worst, fit.worst == kNoSample ? 0 : field_->At(PositionOf(fit.worst))};
}

// From the triangle's last corner, as when it was made: rounding is that of the scan of its star.
DataDependentCriterion::KnownFit DataDependentCriterion::FitBeyond(TriangleId t) {
  if (known_[t].error == kUnknown) {
    const auto [a, b, c] = triangulation_->triangle(t);
    const Triangulation::Vertex p{triangulation_->position(c), triangulation_->height(c)};
    Fit fit;
    FitAround(p, std::array{triangulation_->Seen(a, p.position), triangulation_->Seen(b, p.position)}.data(), 1, &fit);
    known_[t] = Remembered(fit);
  }
  return known_[t];
}

// Of the triangles between p and the vertices of a ring, one after the other.
void DataDependentCriterion::FitAround(const Triangulation::Vertex& p, const RingVertex* ring, std::size_t count,
                                       Fit* fits) {
  if (!UsesMaxima()) {
    for (std::size_t i = 0; i < count; ++i) {
      const RingVertex &u = ring[i], &v = ring[i + 1];
      fits[i].u = u.id;
      fits[i].error = SquaredDistances(
          *field_, {CornerAt(PositionAround(p.position, u), u.height),
                    CornerAt(PositionAround(p.position, v), v.height), CornerAt(p.position, p.height)});
    }
    return;
  }
  std::array<PlaneMisfit, kMostFirstEdges> misfits;
  PrepareScratch(p, count);
  for (std::size_t i = 0; i <= count; ++i) scratch_.ring.Put(i, ring[i]);
  scan_star_(*field_, scratch_, misfits.data());
  const bool is_inside = IsInside(p.position.x, p.position.y);
  bool is_before_inside = IsInside(p.position.x + ring[0].dx, p.position.y + ring[0].dy);
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_after_inside = IsInside(p.position.x + ring[i + 1].dx, p.position.y + ring[i + 1].dy);
    const bool may_have_border = is_inside + is_before_inside + is_after_inside < 2;
    is_before_inside = is_after_inside;
    fits[i] = {std::max(misfits[i].distance, 0.0), misfits[i].distance, misfits[i].sample, ring[i].id};
    if (may_have_border || !sagitta_->is_flat()) [[unlikely]]
      fits[i] = FitOf(misfits[i], p.position, p.height, ring[i], ring[i + 1]);
  }
}

// Whether a sample is not on the field's border.
bool DataDependentCriterion::IsInside(int x, int y) const {
  return static_cast<unsigned>(x - 1) < static_cast<unsigned>(field_->width() - 2) &&
         static_cast<unsigned>(y - 1) < static_cast<unsigned>(field_->height() - 2);
}

DataDependentCriterion::Fit DataDependentCriterion::FitOf(const PlaneMisfit& misfit, SamplePosition p, float p_height,
                                                          const RingVertex& u, const RingVertex& v) const {
  const SamplePosition at_u = PositionAround(p, u), at_v = PositionAround(p, v);
  double error = std::max(misfit.distance, 0.0);
  if (IsInside(at_u.x, at_u.y) + IsInside(at_v.x, at_v.y) + IsInside(p.x, p.y) < 2)
    error = std::max(error, WorstOnBorders(p, p_height, u, v));
  if (!sagitta_->is_flat()) error += sagitta_->Bound(at_u, at_v, p);
  return {error, misfit.distance, misfit.sample, u.id};
}

// Of the triangle's border samples, by their plain distances: a weight would favour one cut over the other only for
// being at the border, and what is decided here is not the bound.
double DataDependentCriterion::WorstOnBorders(SamplePosition p, float p_height, const RingVertex& u,
                                              const RingVertex& v) const {
  double worst = 0;
  const auto raise = [&](SamplePosition a, float a_height, SamplePosition b, float b_height) {
    if (!IsBorderEdge(*field_, a, b)) return;
    worst = std::max(worst,
                     WorstBorderSample(*field_, CornerAt(a, a_height), CornerAt(b, b_height), BorderOptions{}).error);
  };
  const SamplePosition at_u = PositionAround(p, u), at_v = PositionAround(p, v);
  raise(at_u, u.height, at_v, v.height);
  raise(at_v, v.height, p, p_height);
  raise(p, p_height, at_u, u.height);
  return worst;
}

// Brings what is kept into the order of the star: that of the outline. For a vertex on the border the star's order is
// the outline's turned around; what was kept before the gap then finds no place and is scanned again.
void DataDependentCriterion::End(const Star& star) {
  kept_.insert(kept_.end(), pending_.rbegin(), pending_.rend());
  CoverSlots();
  centre_ = star.centre;
  std::swap(kept_, pending_);
  kept_.assign(star.count, {});
  auto next = pending_.begin();
  for (std::size_t i = 0; i < star.count; ++i) {
    if (next != pending_.end() && next->u == star.ring.ids[i]) kept_[i] = *next++;
    known_[star.triangles[i]] = Remembered(kept_[i]);
  }
}

void DataDependentCriterion::Scan(const Star& star, PlaneMisfit* misfits) {
  if (!UsesMaxima()) return scan_star_(*field_, star, misfits);
  if (star.centre == centre_ && star.count == kept_.size()) {
    ScanUnknown(star, misfits);
  } else {
    scan_star_(*field_, star, misfits);
  }
  CoverSlots();
  const SamplePosition p{static_cast<std::uint16_t>(star.x), static_cast<std::uint16_t>(star.y)};
  for (std::size_t i = 0; i < star.count; ++i) {
    KnownFit& known = known_[star.triangles[i]];
    if (known.error == kUnknown) known = Remembered(FitOf(misfits[i], p, star.height, star.ring[i], star.ring[i + 1]));
  }
}

// Runs of neighbours are scanned together.
void DataDependentCriterion::ScanUnknown(const Star& star, PlaneMisfit* misfits) {
  for (std::size_t i = 0; i < star.count;) {
    if (kept_[i].error != kUnknown) {
      misfits[i] = {kept_[i].distance, kept_[i].worst};
      ++i;
      continue;
    }
    const std::size_t first = i;
    while (i < star.count && kept_[i].error == kUnknown) ++i;
    PrepareScratch(vertex_, i - first);
    for (std::size_t k = first; k <= i; ++k) scratch_.ring.Put(k - first, star.ring[k]);
    scan_star_(*field_, scratch_, misfits + first);
  }
}

// A star of `count` triangles around p whose ring is yet to be put.
void DataDependentCriterion::PrepareScratch(const Triangulation::Vertex& p, std::size_t count) {
  scratch_.x = p.position.x;
  scratch_.y = p.position.y;
  scratch_.height = p.height;
  scratch_.count = count;
  scratch_.has_border = true;  // or not: it is looked for
  if (scratch_.ring.capacity() < count + 1) scratch_.ring.Grow(2 * (count + 1));
}

void DataDependentCriterion::CoverSlots() {
  if (known_.size() < triangulation_->triangle_count()) known_.GrowTo(triangulation_->triangle_count(), {});
}

}  // namespace terrace::tin

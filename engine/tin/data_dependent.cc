#include "engine/tin/data_dependent.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/border.h"
#include "engine/tin/plane.h"
#include "engine/tin/squared_distances.h"

namespace terrace::tin {
namespace {

Corner CornerAt(SamplePosition position, float height) { return {position.x, position.y, static_cast<double>(height)}; }

SamplePosition PositionOf(const Corner& corner) {
  return {static_cast<std::uint16_t>(corner.x), static_cast<std::uint16_t>(corner.y)};
}

// An edge with both ends on one border is on that border.
bool IsBorderEdge(const HeightField& field, const Corner& a, const Corner& b) {
  return (a.x == b.x && (a.x == 0 || a.x == field.width() - 1)) ||
         (a.y == b.y && (a.y == 0 || a.y == field.height() - 1));
}

// A star of `count` triangles with the ring yet to be put.
void Prepare(Star& star, const Triangulation::Vertex& centre, std::size_t count) {
  star.x = centre.position.x;
  star.y = centre.position.y;
  star.height = centre.height;
  star.is_closed = false;
  star.count = count;
  if (star.ring.capacity() < count + 1) star.ring.Grow(2 * count + 2);
}

// How far a sample is from the triangle (u, v, p), in the form of the scan: equal bit for bit. x and y are relative to p.
double DistanceFrom(const RingVertex& u, const RingVertex& v, float p_height, int x, int y, float height) {
  const double ux = u.dx, uy = u.dy, vx = v.dx, vy = v.dy, pz = static_cast<double>(p_height);
  const double uz = static_cast<double>(u.height) - pz, vz = static_cast<double>(v.height) - pz;
  const double d = ux * vy - uy * vx, a = vy * uz - uy * vz, b = ux * vz - vx * uz;
  return std::abs(d * (static_cast<double>(height) - pz) - (a * x + b * y)) / d;
}

}  // namespace

DataDependentCriterion::DataDependentCriterion(const HeightField& field, const OpenSamples& open, const Sagitta& sagitta,
                                               const Triangulation& triangulation, DataDependentOptions options)
    : field_(&field),
      open_(&open),
      sagitta_(&sagitta),
      triangulation_(&triangulation),
      options_(options) {
  TERRACE_CHECK(options_.qthresh >= 0 && options_.qthresh <= 1);
}

void DataDependentCriterion::Begin(const Triangulation::Vertex& vertex) {
  vertex_ = vertex;
  pending_.clear();
  kept_.clear();
}

bool DataDependentCriterion::Absorbs(const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back) {
  if (Cross(u, v) == 0) return true;
  Fit uv = TakePending(u.id, v.id), uw, wv;
  const bool absorbs = Sees(u, v, w) && IsBetterAlongPw({u, v, w, vertex_.height}, back / 4, uv, uw, wv);
  if (absorbs) {
    if (wv.error != kUnknown) pending_.push_back({w.id, v.id, wv});
    if (uw.error != kUnknown) pending_.push_back({u.id, w.id, uw});
  } else if (uv.error != kUnknown) {
    kept_.push_back({u.id, v.id, uv});
  }
  return absorbs;
}

// The outline is walked in order, like a stack: what lies above the edge asked for was on the border and stays.
DataDependentCriterion::Fit DataDependentCriterion::TakePending(VertexId u, VertexId v) {
  while (!pending_.empty()) {
    const Spanned top = pending_.back();
    pending_.pop_back();
    if (top.u == u && top.v == v) return top.fit;
    kept_.push_back(top);
  }
  return {};
}

// Sets the fits that it had to find out.
bool DataDependentCriterion::IsBetterAlongPw(const Quadrilateral& q, TriangleId beyond, Fit& uv, Fit& uw, Fit& wv) {
  const ShapeQuality quality = ShapeQualityOf(q);
  if (std::min(quality.uv, quality.pw) <= options_.qthresh * std::max(quality.uv, quality.pw)) {
    return quality.pw > quality.uv;
  }
  if (options_.measure == FitMeasure::kNormals) return BendsLessAlongPw(q);

  if (uv.error == kUnknown) uv = FitOf(q.u, q.v);
  const double error = Combine(uv.error, ErrorBeyond(beyond));
  const bool pw_wins_ties = quality.pw > quality.uv;
  if (error == 0) return false;
  const auto cannot_win = [&](double of_uw, double of_wv) { return pw_wins_ties ? Combine(of_uw, of_wv) > error : Combine(of_uw, of_wv) >= error; };
  double least_uw = 0, least_wv = 0;
  if (UsesMaxima()) {
    RaiseLeastErrors(q, worst_[beyond], least_uw, least_wv);
    RaiseLeastErrors(q, uv.misfit.sample, least_uw, least_wv);
    if (cannot_win(least_uw, least_wv)) return false;
  }
  if (least_uw >= least_wv) {
    uw = FitOf(q.u, q.w);
    if (cannot_win(uw.error, least_wv)) return false;
    wv = FitOf(q.w, q.v);
  } else {
    wv = FitOf(q.w, q.v);
    if (cannot_win(least_uw, wv.error)) return false;
    uw = FitOf(q.u, q.w);
  }
  return !cannot_win(uw.error, wv.error);
}

// An open sample of the quadrilateral is in one of the new triangles: that one is off by no less than there. Rounding does
// not matter, since maxima and sums of what is not negative are monotonic as computed.
void DataDependentCriterion::RaiseLeastErrors(const Quadrilateral& q, std::uint32_t sample, double& uw,
                                              double& wv) const {
  if (sample == kNoSample) return;
  const auto width = static_cast<std::uint32_t>(field_->width());
  const SamplePosition position{static_cast<std::uint16_t>(sample % width), static_cast<std::uint16_t>(sample / width)};
  const float height = open_->At(position);
  const int x = position.x - vertex_.position.x, y = position.y - vertex_.position.y;
  const RingVertex seen{0, x, y, height};
  // A border sample is not open: NaN raises nothing.
  if (Cross(q.w, seen) <= 0) uw = std::max(uw, DistanceFrom(q.u, q.w, vertex_.height, x, y, height));
  if (Cross(q.w, seen) >= 0) wv = std::max(wv, DistanceFrom(q.w, q.v, vertex_.height, x, y, height));
}

// From the triangle's last corner, as when it was made: rounding is that of the scan of its star.
double DataDependentCriterion::ErrorBeyond(TriangleId t) {
  CoverSlots();
  if (errors_[t] != kUnknown) return errors_[t];
  const auto [a, b, c] = triangulation_->triangle(t);
  const Triangulation::Vertex centre{triangulation_->position(c), triangulation_->height(c)};
  const auto seen = [&](VertexId id) -> RingVertex {
    const SamplePosition position = triangulation_->position(id);
    return {id, position.x - centre.position.x, position.y - centre.position.y, triangulation_->height(id)};
  };
  const Fit fit = FitAround(centre, seen(a), seen(b));
  Note(t, fit);
  return fit.error;
}

DataDependentCriterion::Fit DataDependentCriterion::FitOf(const RingVertex& u, const RingVertex& v) {
  return FitAround(vertex_, u, v);
}

DataDependentCriterion::Fit DataDependentCriterion::FitAround(const Triangulation::Vertex& centre, const RingVertex& u,
                                                              const RingVertex& v) {
  const std::array<Corner, 3> corners = {CornerOf(u.id), CornerOf(v.id), CornerAt(centre.position, centre.height)};
  if (!UsesMaxima()) return {SquaredDistances(*field_, corners), {}};
  Fit fit;
  Prepare(scratch_, centre, 1);
  scratch_.ring.Put(0, u);
  scratch_.ring.Put(1, v);
  scan_star_(*open_, scratch_, &fit.misfit);
  fit.error = ErrorOf(fit.misfit, corners[0], corners[1], corners[2]);
  return fit;
}

Corner DataDependentCriterion::CornerOf(VertexId vertex) const {
  return CornerAt(triangulation_->position(vertex), triangulation_->height(vertex));
}

void DataDependentCriterion::CoverSlots() {
  if (errors_.size() >= triangulation_->triangle_count()) return;
  errors_.resize(triangulation_->triangle_count(), kUnknown);
  worst_.resize(triangulation_->triangle_count(), kNoSample);
}

void DataDependentCriterion::Note(TriangleId t, const Fit& fit) {
  errors_[t] = fit.error;
  worst_[t] = fit.misfit.sample;
}

// With the triangle's border samples, by their plain distances: a weight would only favour one cut over the other where
// the border is, and what is decided here is not the bound.
double DataDependentCriterion::ErrorOf(const PlaneMisfit& misfit, const Corner& u, const Corner& v,
                                       const Corner& p) const {
  double distance = std::max(misfit.distance, 0.0);
  for (const auto& [a, b] : {std::pair(u, v), {v, p}, {p, u}}) {
    if (IsBorderEdge(*field_, a, b)) distance = std::max(distance, WorstBorderSample(*field_, a, b, {}).error);
  }
  return sagitta_->is_flat() ? distance : distance + sagitta_->Bound(PositionOf(u), PositionOf(v), PositionOf(p));
}

void DataDependentCriterion::End(const Star& star) {
  kept_.insert(kept_.end(), pending_.rbegin(), pending_.rend());
  CoverSlots();
  centre_ = star.centre;
  fits_.assign(star.count, {});
  // Both are in the order of the outline. A ring that has been turned, on the border, may leave some out.
  auto next = kept_.begin();
  for (std::size_t i = 0; i < star.count && next != kept_.end(); ++i) {
    if (next->u == star.ring.ids[i] && next->v == star.ring.ids[i + 1]) fits_[i] = (next++)->fit;
  }
  for (std::size_t i = 0; i < star.count; ++i) Note(star.triangles[i], fits_[i]);
}

void DataDependentCriterion::Scan(const Star& star, PlaneMisfit* misfits) {
  if (!UsesMaxima() || star.count != fits_.size() || star.centre != centre_) {
    scan_star_(*open_, star, misfits);
  } else {
    ScanUnknown(star, misfits);
  }
  if (!UsesMaxima()) return;
  CoverSlots();
  const Corner p{star.x, star.y, static_cast<double>(star.height)};
  for (std::size_t i = 0; i < star.count; ++i) {
    const TriangleId t = star.triangles[i];
    if (errors_[t] != kUnknown) continue;
    Note(t, {ErrorOf(misfits[i], CornerOf(star.ring.ids[i]), CornerOf(star.ring.ids[i + 1]), p), misfits[i]});
  }
}

// Runs of neighbours are scanned together.
void DataDependentCriterion::ScanUnknown(const Star& star, PlaneMisfit* misfits) {
  for (std::size_t i = 0; i < star.count;) {
    if (fits_[i].error != kUnknown) {
      misfits[i] = fits_[i].misfit;
      ++i;
      continue;
    }
    const std::size_t first = i;
    while (i < star.count && fits_[i].error == kUnknown) ++i;
    Prepare(scratch_, vertex_, i - first);
    for (std::size_t k = first; k <= i; ++k) scratch_.ring.Put(k - first, star.ring[k]);
    scan_star_(*open_, scratch_, misfits + first);
  }
}

}  // namespace terrace::tin

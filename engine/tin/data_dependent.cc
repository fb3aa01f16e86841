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

SamplePosition PositionAround(SamplePosition p, const RingVertex& vertex) {
  return {static_cast<std::uint16_t>(p.x + vertex.dx), static_cast<std::uint16_t>(p.y + vertex.dy)};
}

Corner CornerAt(SamplePosition position, float height) { return {position.x, position.y, static_cast<double>(height)}; }

// An edge with both ends on one border is on that border.
bool IsBorderEdge(const HeightField& field, SamplePosition a, SamplePosition b) {
  return (a.x == b.x && (a.x == 0 || a.x == field.width() - 1)) ||
         (a.y == b.y && (a.y == 0 || a.y == field.height() - 1));
}

// A star of `count` triangles around p whose ring is yet to be put.
void Prepare(Star& star, const Triangulation::Vertex& p, std::size_t count) {
  star.x = p.position.x;
  star.y = p.position.y;
  star.height = p.height;
  star.count = count;
  if (star.ring.capacity() < count + 1) star.ring.Grow(2 * (count + 1));
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

DataDependentCriterion::DataDependentCriterion(const HeightField& field, const OpenSamples& open,
                                               const Sagitta& sagitta, const Triangulation& triangulation,
                                               DataDependentOptions options)
    : field_(&field), open_(&open), sagitta_(&sagitta), triangulation_(&triangulation), options_(options) {
  TERRACE_CHECK(options_.qthresh >= 0 && options_.qthresh <= 1);
}

// The triangle's own three edges are the first to be suspect, and most of them stay: fitted together.
void DataDependentCriterion::Begin(const Triangulation::Vertex& vertex, TriangleId triangle) {
  vertex_ = vertex;
  pending_.clear();
  kept_.clear();
  if (!UsesMaxima()) return;
  CoverSlots();
  for (HalfEdgeId edge = 4 * triangle; edge < 4 * triangle + 3; ++edge) {
    const HalfEdgeId back = triangulation_->twin(edge);
    if (back != kNoEdge) __builtin_prefetch(&known_[back / 4]);
  }
  const auto [a, b, c] = triangulation_->triangle(triangle);
  const std::array<RingVertex, 4> ring = {
      triangulation_->Seen(a, vertex.position), triangulation_->Seen(b, vertex.position),
      triangulation_->Seen(c, vertex.position), triangulation_->Seen(a, vertex.position)};
  for (std::size_t i = 0; i < 3; ++i) {
    if (Cross(ring[i], ring[i + 1]) == 0) return;  // on an edge: no triangle there
  }
  const std::array<Fit, 3> fits = FitsAround<3>(vertex, ring);
  for (std::size_t i = 3; i-- > 0;) pending_.push_back({ring[i].id, ring[i + 1].id, fits[i]});
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

// Sets the fits that it had to find out. Equal fits, frequent where heights are whole metres: the better shape.
bool DataDependentCriterion::IsBetterAlongPw(const Quadrilateral& q, TriangleId beyond, Fit& uv, Fit& uw, Fit& wv) {
  const ShapeQuality quality = ShapeQualityOf(q);
  const bool is_shaped_better = quality.pw > quality.uv;
  const auto fit_new = [&] {
    const std::array<Fit, 2> fits = FitsAround<2>(vertex_, {q.u, q.w, q.v});
    uw = fits[0];
    wv = fits[1];
  };
  if (std::min(quality.uv, quality.pw) <= options_.qthresh * std::max(quality.uv, quality.pw)) {
    if (is_shaped_better && UsesMaxima()) fit_new();  // most of them stay: fitted together
    return is_shaped_better;
  }
  if (options_.measure == FitMeasure::kNormals) return BendsLessAlongPw(q);

  const KnownFit known = FitBeyond(beyond);
  if (uv.error == kUnknown) uv = FitsAround<1>(vertex_, {q.u, q.v})[0];
  const double error = Combine(uv.error, known.error);
  if (error == 0) return false;
  const auto wins = [&](double of_uw, double of_wv) {
    const double other = Combine(of_uw, of_wv);
    return is_shaped_better ? other <= error : other < error;
  };
  if (UsesMaxima()) {
    double least_uw = 0, least_wv = 0;
    if (known.worst != kNoSample) RaiseLeastErrors(q, known.worst, known.worst_height, least_uw, least_wv);
    if (const std::uint32_t worst = uv.misfit.sample; worst != kNoSample) {
      RaiseLeastErrors(q, worst, open_->At(PositionOf(worst, field_->width())), least_uw, least_wv);
    }
    if (!wins(least_uw, least_wv)) return false;
  }
  fit_new();
  return wins(uw.error, wv.error);
}

// An open sample of the quadrilateral is in one of the new triangles: that one is off by no less than there. Rounding
// does not matter, since maxima and sums of what is not negative are monotonic as computed.
void DataDependentCriterion::RaiseLeastErrors(const Quadrilateral& q, std::uint32_t sample, float height, double& uw,
                                              double& wv) const {
  const SamplePosition position = PositionOf(sample, field_->width());
  const int x = position.x - vertex_.position.x, y = position.y - vertex_.position.y;
  const std::int64_t side = Cross(q.w, RingVertex{0, x, y, height});
  if (side <= 0) uw = std::max(uw, DistanceFrom(q.u, q.w, vertex_.height, x, y, height));
  if (side >= 0) wv = std::max(wv, DistanceFrom(q.w, q.v, vertex_.height, x, y, height));
}

DataDependentCriterion::KnownFit DataDependentCriterion::Remembered(const Fit& fit) const {
  const std::uint32_t worst = fit.misfit.sample;
  return {fit.error, worst, worst == kNoSample ? 0 : open_->At(PositionOf(worst, field_->width()))};
}

// From the triangle's last corner, as when it was made: rounding is that of the scan of its star.
DataDependentCriterion::KnownFit DataDependentCriterion::FitBeyond(TriangleId t) {
  CoverSlots();
  if (known_[t].error == kUnknown) {
    const auto [a, b, c] = triangulation_->triangle(t);
    const Triangulation::Vertex p{triangulation_->position(c), triangulation_->height(c)};
    const Fit fit = FitsAround<1>(p, {triangulation_->Seen(a, p.position), triangulation_->Seen(b, p.position)})[0];
    known_[t] = Remembered(fit);
  }
  return known_[t];
}

template <std::size_t kCount>
std::array<DataDependentCriterion::Fit, kCount> DataDependentCriterion::FitsAround(
    const Triangulation::Vertex& p, const std::array<RingVertex, kCount + 1>& ring) {
  std::array<Fit, kCount> fits;
  if (!UsesMaxima()) {
    for (std::size_t i = 0; i < kCount; ++i) {
      const RingVertex &u = ring[i], &v = ring[i + 1];
      fits[i].error = SquaredDistances(
          *field_, {CornerAt(PositionAround(p.position, u), u.height),
                    CornerAt(PositionAround(p.position, v), v.height), CornerAt(p.position, p.height)});
    }
    return fits;
  }
  std::array<PlaneMisfit, kCount> misfits;
  Prepare(scratch_, p, kCount);
  for (std::size_t i = 0; i <= kCount; ++i) scratch_.ring.Put(i, ring[i]);
  scan_star_(*open_, scratch_, misfits.data());
  for (std::size_t i = 0; i < kCount; ++i) fits[i] = {ErrorOf(misfits[i], p, ring[i], ring[i + 1]), misfits[i]};
  return fits;
}

// With the triangle's border samples, by their plain distances: a weight would favour one cut over the other only for
// being at the border, and what is decided here is not the bound.
double DataDependentCriterion::ErrorOf(const PlaneMisfit& misfit, const Triangulation::Vertex& p, const RingVertex& u,
                                       const RingVertex& v) const {
  const SamplePosition at_u = PositionAround(p.position, u), at_v = PositionAround(p.position, v);
  double distance = std::max(misfit.distance, 0.0);
  const auto raise = [&](SamplePosition a, float a_height, SamplePosition b, float b_height) {
    if (!IsBorderEdge(*field_, a, b)) return;
    distance = std::max(
        distance, WorstBorderSample(*field_, CornerAt(a, a_height), CornerAt(b, b_height), BorderOptions{}).error);
  };
  raise(at_u, u.height, at_v, v.height);
  if (p.position.x == 0 || p.position.y == 0 || p.position.x == field_->width() - 1 ||
      p.position.y == field_->height() - 1) {
    raise(at_v, v.height, p.position, p.height);
    raise(p.position, p.height, at_u, u.height);
  }
  return sagitta_->is_flat() ? distance : distance + sagitta_->Bound(at_u, at_v, p.position);
}

void DataDependentCriterion::End(const Star& star) {
  kept_.insert(kept_.end(), pending_.rbegin(), pending_.rend());
  CoverSlots();
  centre_ = star.centre;
  fits_.assign(star.count, {});
  // Both are in the order of the outline. A ring that has been turned, on the border, may leave some out.
  auto next = kept_.begin();
  for (std::size_t i = 0; i < star.count; ++i) {
    if (next != kept_.end() && next->u == star.ring.ids[i] && next->v == star.ring.ids[i + 1]) fits_[i] = (next++)->fit;
    known_[star.triangles[i]] = Remembered(fits_[i]);
  }
}

void DataDependentCriterion::Scan(const Star& star, PlaneMisfit* misfits) {
  if (!UsesMaxima()) return scan_star_(*open_, star, misfits);
  if (star.centre == centre_ && star.count == fits_.size()) {
    ScanUnknown(star, misfits);
  } else {
    scan_star_(*open_, star, misfits);
  }
  CoverSlots();
  const Triangulation::Vertex p{{static_cast<std::uint16_t>(star.x), static_cast<std::uint16_t>(star.y)}, star.height};
  for (std::size_t i = 0; i < star.count; ++i) {
    KnownFit& known = known_[star.triangles[i]];
    if (known.error == kUnknown) {
      known = Remembered({ErrorOf(misfits[i], p, star.ring[i], star.ring[i + 1]), misfits[i]});
    }
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

void DataDependentCriterion::CoverSlots() {
  if (known_.size() < triangulation_->triangle_count()) known_.GrowTo(triangulation_->triangle_count(), {});
}

}  // namespace terrace::tin

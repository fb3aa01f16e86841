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
  scratch_.ring.Grow(kMostFitted + 1);
}

const Star& DataDependentCriterion::Insert(const Triangulation::Vertex& vertex, TriangleId triangle) {
  vertex_ = vertex;
  Begin(triangle);
  const Star& star = triangulation_->Insert(
      vertex, triangle,
      [this](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back, WalkPlace place) {
        return Absorbs(u, v, w, back, place);
      },
      [this](WalkPlace place) { Keep(place); });
  End(star);
  return star;
}

// The edges of the triangle are the first to be suspect, and most of them stay: fitted together. Where the vertex lies
// on one of them, as is frequent, those of the triangle beyond take its place.
void DataDependentCriterion::Begin(TriangleId triangle) {
  fit_count_ = 1;
  CoverSlots();
  std::fill_n(pending_.begin() + 1, 3, kUnknownFit);
  split_.fill(kUnknownFit);
  if (!UsesMaxima()) return;
  const auto seen = [&](VertexId corner) { return triangulation_->Seen(corner, vertex_.position); };
  const auto [a, b, c] = triangulation_->triangle(triangle);
  const std::array<RingVertex, 3> corners = {seen(a), seen(b), seen(c)};
  std::array<HalfEdgeId, 3> backs;
  std::size_t split = 3;
  for (std::uint32_t i = 0; i < 3; ++i) {
    backs[i] = triangulation_->twin(4 * triangle + i);
    // Of an edge on the border it is some address, which does no harm.
    const auto known = reinterpret_cast<std::uintptr_t>(known_.data());
    __builtin_prefetch(reinterpret_cast<const void*>(known + sizeof(KnownFit) * (backs[i] / 4)));
    split = Cross(corners[i], corners[(i + 1) % 3]) == 0 ? i : split;
  }
  // Edge i comes i-th, and the walk's stack has it in the place 3 - i.
  if (split == 3) {
    const FitId fits = FitAround<4>(vertex_, {corners[0], corners[1], corners[2], corners[0]});
    for (std::uint32_t i = 0; i < 3; ++i) pending_[3 - i] = fits + i;
    return;
  }
  const std::size_t next = (split + 1) % 3, last = (split + 2) % 3;
  FitId fits = 0;
  if (backs[split] == kNoEdge) {
    fits = FitAround<3>(vertex_, {corners[next], corners[last], corners[split]});
  } else {
    const RingVertex beyond = seen(triangulation_->corner(Triangulation::Previous(backs[split])));
    fits = FitAround<5>(vertex_, {corners[split], beyond, corners[next], corners[last], corners[split]});
    split_ = {fits, fits + 1};
    fits += 2;
  }
  pending_[3 - next] = fits;
  pending_[3 - last] = fits + 1;
}

bool DataDependentCriterion::Absorbs(const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back,
                                     WalkPlace place) {
  if (place.pending + 1 >= pending_.size()) [[unlikely]]
    pending_.resize(2 * pending_.size());
  // w-v takes the place of u-v, and u-w, which is asked about next, the one after it.
  FitId& uv = pending_[place.pending];
  FitId& uw = pending_[place.pending + 1];
  if (Cross(u, v) == 0) [[unlikely]] {
    uw = split_[0];
    uv = split_[1];
    return true;
  }
  FitId halves = kUnknownFit;
  if (!Sees(u, v, w) || !IsBetterAlongPw({u, v, w, vertex_.height}, back / 4, uv, halves)) return false;
  uw = halves;
  uv = halves == kUnknownFit ? kUnknownFit : halves + 1;
  return true;
}

void DataDependentCriterion::Keep(WalkPlace place) {
  if (place.kept >= kept_.size()) [[unlikely]]
    kept_.resize(2 * kept_.size());
  kept_[place.kept] = pending_[place.pending];
}

// Sets the fits that it had to find out; that of u-v is known before with maxima. Equal fits, frequent where heights
// are whole metres: the better shape.
bool DataDependentCriterion::IsBetterAlongPw(const Quadrilateral& q, TriangleId beyond, FitId& uv, FitId& halves) {
  const ShapeQuality quality = ShapeQualityOf(q);
  const bool is_shaped_better = quality.pw > quality.uv;
  const auto fit_halves = [&] { halves = FitAround<3>(vertex_, {q.u, q.w, q.v}); };
  // The smaller one is at most so much of the larger one, without asking which is which.
  if ((quality.uv <= options_.qthresh * quality.pw) | (quality.pw <= options_.qthresh * quality.uv)) {
    if (is_shaped_better && UsesMaxima()) fit_halves();  // most of them stay: fitted together
    return is_shaped_better;
  }
  if (options_.measure == FitMeasure::kNormals) return BendsLessAlongPw(q);

  const KnownFit known = FitBeyond(beyond);
  if (uv == kUnknownFit) uv = FitAround<2>(vertex_, {q.u, q.v});
  const double error = Combine(fits_[uv].error, known.error);
  if (error == 0) return false;
  const auto wins = [&](double of_uw, double of_wv) {
    const double other = Combine(of_uw, of_wv);
    return (other < error) | ((other == error) & is_shaped_better);
  };
  if (UsesMaxima()) {
    std::array<double, 2> least{};
    if (known.worst != kNoSample) RaiseLeastErrors(q, known.worst, known.worst_height, least);
    const std::uint32_t worst = fits_[uv].worst;
    if (worst != kNoSample) RaiseLeastErrors(q, worst, field_->At(PositionOf(worst)), least);
    if (!wins(least[0], least[1])) return false;
  }
  fit_halves();
  return wins(fits_[halves].error, fits_[halves + 1].error);
}

// A sample of the quadrilateral is in one of the new triangles, (u, w, p) and (w, v, p): that one is off by no less
// than there. Rounding does not matter, since maxima and sums of what is not negative are monotonic as computed.
void DataDependentCriterion::RaiseLeastErrors(const Quadrilateral& q, std::uint32_t sample, float height,
                                              std::array<double, 2>& least) const {
  const SamplePosition position = PositionOf(sample);
  const int x = position.x - vertex_.position.x, y = position.y - vertex_.position.y;
  const std::array<const RingVertex*, 3> ring = {&q.u, &q.w, &q.v};
  const auto raise = [&](std::size_t i) {
    least[i] = std::max(least[i], DistanceFrom(*ring[i], *ring[i + 1], vertex_.height, x, y, height));
  };
  // Which one cannot be foretold.
  const std::int32_t side = Cross(q.w, RingVertex{0, x, y, height});
  raise(side > 0 ? 1 : 0);
  if (side == 0) [[unlikely]]
    raise(1);
}

DataDependentCriterion::KnownFit DataDependentCriterion::Remembered(const Fit& fit) const {
  // The height of none is never asked for. Not a branch: whether there is one cannot be foretold.
  const std::uint32_t sample = fit.worst & -static_cast<std::uint32_t>(fit.worst != kNoSample);
  return {fit.error, fit.worst, field_->At(PositionOf(sample))};
}

// From the triangle's last corner, as when it was made: rounding is that of the scan of its star.
DataDependentCriterion::KnownFit DataDependentCriterion::FitBeyond(TriangleId t) {
  if (known_[t].error == kUnknown) [[unlikely]] {
    const auto [a, b, c] = triangulation_->triangle(t);
    const Triangulation::Vertex p{triangulation_->position(c), triangulation_->height(c)};
    const auto seen = [&](VertexId corner) { return triangulation_->Seen(corner, p.position); };
    known_[t] = Remembered(fits_[FitAround<2>(p, {seen(a), seen(b)})]);
  }
  return known_[t];
}

// Of the triangles between p and the vertices of a ring, one after the other. How many there are is known where it is
// called.
template <std::size_t kVertices>
DataDependentCriterion::FitId DataDependentCriterion::FitAround(const Triangulation::Vertex& p,
                                                                const std::array<RingVertex, kVertices>& ring) {
  constexpr std::size_t kTriangles = kVertices - 1;
  static_assert(kTriangles <= kMostFitted);
  const FitId first = fit_count_;
  fit_count_ += kTriangles;
  if (fits_.size() < fit_count_) [[unlikely]]
    fits_.resize(2 * fit_count_);
  Fit* const fits = fits_.data() + first;
  if (!UsesMaxima()) {
    for (std::size_t i = 0; i < kTriangles; ++i) {
      const RingVertex &u = ring[i], &v = ring[i + 1];
      fits[i].error = SquaredDistances(
          *field_, {CornerAt(PositionAround(p.position, u), u.height),
                    CornerAt(PositionAround(p.position, v), v.height), CornerAt(p.position, p.height)});
    }
    return first;
  }
  scratch_.x = p.position.x;
  scratch_.y = p.position.y;
  scratch_.height = p.height;
  scratch_.count = kTriangles;
  int inside = IsInside(p.position.x, p.position.y);
  for (std::size_t i = 0; i < kVertices; ++i) {
    scratch_.ring.Put(i, ring[i]);
    inside += IsInside(p.position.x + ring[i].dx, p.position.y + ring[i].dy);
  }
  scratch_.has_border = inside < static_cast<int>(kVertices);  // two vertices less, or one of a triangle alone
  std::array<PlaneMisfit, kTriangles> misfits;
  scan_star_(*field_, scratch_, misfits.data());
  if (scratch_.has_border || !sagitta_->is_flat()) [[unlikely]] {
    for (std::size_t i = 0; i < kTriangles; ++i) {
      fits[i] = FitOf(misfits[i], p.position, p.height, ring[i], ring[i + 1]);
    }
    return first;
  }
  for (std::size_t i = 0; i < kTriangles; ++i) {
    fits[i] = {misfits[i].distance > 0 ? misfits[i].distance : 0, misfits[i].distance, misfits[i].sample};
  }
  return first;
}

// Whether a sample is not on the field's border.
bool DataDependentCriterion::IsInside(int x, int y) const {
  const bool is_column_inside = static_cast<unsigned>(x - 1) < static_cast<unsigned>(field_->width() - 2);
  const bool is_row_inside = static_cast<unsigned>(y - 1) < static_cast<unsigned>(field_->height() - 2);
  return is_column_inside & is_row_inside;
}

DataDependentCriterion::Fit DataDependentCriterion::FitOf(const PlaneMisfit& misfit, SamplePosition p, float p_height,
                                                          const RingVertex& u, const RingVertex& v) const {
  const SamplePosition at_u = PositionAround(p, u), at_v = PositionAround(p, v);
  double error = std::max(misfit.distance, 0.0);
  if (IsInside(at_u.x, at_u.y) + IsInside(at_v.x, at_v.y) + IsInside(p.x, p.y) < 2)
    error = std::max(error, WorstOnBorders(p, p_height, u, v));
  if (!sagitta_->is_flat()) error += sagitta_->Bound(at_u, at_v, p);
  return {error, misfit.distance, misfit.sample};
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

// What was found out on the way is what a scan of the star would find.
void DataDependentCriterion::End(const Star& star) {
  const std::size_t outline = star.count + (star.is_closed ? 0 : 1);
  CoverSlots();
  MakeRoom(star);
  centre_ = star.centre;
  count_ = star.count;
  for (std::size_t i = 0; i < star.count; ++i) {
    std::size_t edge = i;
    if (!star.is_closed) [[unlikely]]
      edge = (star.gap + 1 + i) % outline;
    TERRACE_CHECK(kept_[edge] != kUnknownFit || !UsesMaxima());  // all that an edge can come from is fitted
    const Fit& fit = fits_[kept_[edge]];
    known_[star.triangles[i]] = Remembered(fit);
    misfits_[i] = {fit.distance, fit.worst};
  }
}

const PlaneMisfit* DataDependentCriterion::Scan(const Star& star) {
  if (UsesMaxima() && star.centre == centre_ && star.count == count_) return misfits_.data();
  MakeRoom(star);
  scan_star_(*field_, star, misfits_.data());
  count_ = 0;
  if (!UsesMaxima()) return misfits_.data();
  CoverSlots();
  const SamplePosition p{static_cast<std::uint16_t>(star.x), static_cast<std::uint16_t>(star.y)};
  for (std::size_t i = 0; i < star.count; ++i) {
    known_[star.triangles[i]] = Remembered(FitOf(misfits_[i], p, star.height, star.ring[i], star.ring[i + 1]));
  }
  return misfits_.data();
}

void DataDependentCriterion::MakeRoom(const Star& star) {
  if (misfits_.size() < star.count) misfits_.resize(star.ring.capacity());
}

void DataDependentCriterion::CoverSlots() {
  if (known_.size() < triangulation_->triangle_count()) known_.GrowTo(triangulation_->triangle_count(), {});
}

}  // namespace terrace::tin

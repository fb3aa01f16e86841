#include "engine/tin/data_dependent.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/border.h"
#include "engine/tin/mesh/plane.h"
#include "engine/tin/scan/triangle_spans.h"

namespace terrace::tin {
namespace {

Triangulation::Vertex Around(SamplePosition p, const RingVertex& vertex) {
  return {{static_cast<std::uint16_t>(p.x + vertex.dx), static_cast<std::uint16_t>(p.y + vertex.dy)}, vertex.height};
}

Corner CornerAt(const Triangulation::Vertex& vertex) {
  return {vertex.position.x, vertex.position.y, static_cast<double>(vertex.height)};
}

// An edge with both ends on one border is on that border.
bool IsBorderEdge(const HeightField& field, SamplePosition a, SamplePosition b) {
  return (a.x == b.x && (a.x == 0 || a.x == field.width() - 1)) ||
         (a.y == b.y && (a.y == 0 || a.y == field.height() - 1));
}

}  // namespace

FitErrors::FitErrors(const HeightField& field, const Sagitta& sagitta, FitMeasure measure)
    : field_(&field), sagitta_(&sagitta), measure_(measure) {
  lone_star_.count = 1;
  lone_star_.has_border = true;  // perhaps; borders are checked
  lone_star_.ring.Grow(2);
}

void FitErrors::AddBordersAndSagitta(const Star& star, const PlaneMisfit* worst, double* misfits) const {
  const Triangulation::Vertex p{{static_cast<std::uint16_t>(star.x), static_cast<std::uint16_t>(star.y)}, star.height};
  for (std::size_t i = 0; i < star.count; ++i) {
    if (!star.IsLeftOut(i)) misfits[i] = Of(worst[i], p, star.ring[i], star.ring[i + 1]);
  }
}

double FitErrors::Of(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v) {
  if (!are_maxima()) {
    return SquaredDistances(*field_, {CornerAt(Around(p.position, u)), CornerAt(Around(p.position, v)), CornerAt(p)});
  }
  lone_star_.x = p.position.x;
  lone_star_.y = p.position.y;
  lone_star_.height = p.height;
  lone_star_.ring.Put(0, u);
  lone_star_.ring.Put(1, v);
  PlaneMisfit misfit;
  scan_star_(*field_, lone_star_, &misfit);
  return Of(misfit, p, u, v);
}

double FitErrors::Of(const PlaneMisfit& misfit, const Triangulation::Vertex& p, const RingVertex& u,
                     const RingVertex& v) const {
  const SamplePosition at_u = Around(p.position, u).position, at_v = Around(p.position, v).position;
  double error = DistanceOrZero(misfit);
  if (IsInside(at_u) + IsInside(at_v) + IsInside(p.position) < 2) error = std::max(error, WorstOnBorders(p, u, v));
  if (!sagitta_->is_flat()) error += sagitta_->Bound(at_u, at_v, p.position);
  return error;
}

// The worst border sample of the triangle, by unweighted distance: a weight would favour one cut only because it is at
// the border, and the bound is not decided here.
double FitErrors::WorstOnBorders(const Triangulation::Vertex& p, const RingVertex& u, const RingVertex& v) const {
  const std::array<Triangulation::Vertex, 3> corners = {p, Around(p.position, u), Around(p.position, v)};
  double worst = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Triangulation::Vertex &a = corners[i], &b = corners[(i + 1) % 3];
    if (!IsBorderEdge(*field_, a.position, b.position)) continue;
    worst = std::max(worst, WorstBorderSample(*field_, CornerAt(a), CornerAt(b), BorderOptions{}).error);
  }
  return worst;
}

// Whether a sample is not on the field's border.
bool FitErrors::IsInside(SamplePosition sample) const {
  const bool is_column_inside = sample.x > 0 && sample.x < field_->width() - 1;
  const bool is_row_inside = sample.y > 0 && sample.y < field_->height() - 1;
  return is_column_inside && is_row_inside;
}

DataDependentCriterion::DataDependentCriterion(const HeightField& field, const Sagitta& sagitta,
                                               Triangulation& triangulation, DataDependentOptions options)
    : triangulation_(&triangulation),
      options_(options),
      taken_below_(options.qthresh * options.qthresh),
      kept_below_(options.qthresh * std::sqrt(std::sqrt(options.qthresh))),
      kept_further_out_below_(std::sqrt(std::sqrt(options.qthresh))),
      fit_errors_(field, sagitta, options.measure) {
  TERRACE_CHECK(options_.qthresh >= 0 && options_.qthresh <= 1);
  pairs_.ring.Grow(3 * kMaxPairs);
}

const Star& DataDependentCriterion::Insert(Triangulation::Vertex vertex, TriangleId triangle) {
  vertex_ = vertex;
  CoverSlots();
  suspect_count_ = flip_count_ = edge_count_ = 0;
  Star& star = OutlineByShape(vertex, triangle);
  FitOutline(star);
  if (flip_count_ > 0) ReplaceEdges(star);
  triangulation_->Fill();
  CoverSlots();
  centre_ = star.centre;
  count_ = star.count;
  for (std::size_t i = 0; i < star.count; ++i) errors_by_slot_[star.triangles[i]] = errors_[i];
  return star;
}

// Collects as suspects the edges that the fit decides; none if normals decide, which needs no scan.
Star& DataDependentCriterion::OutlineByShape(const Triangulation::Vertex& vertex, TriangleId triangle) {
  bool is_suspect = false;
  Suspect* suspect = suspects_.data();
  Star& star = triangulation_->Outline(
      vertex, triangle,
      [&](const RingVertex& u, const RingVertex& v, const RingVertex& w, HalfEdgeId back)
          __attribute__((always_inline)) {
            PrefetchError(back / 4);
            const Quadrilateral q{u, v, w, vertex.height};
            const ShapeQuality quality = QualityOf(q);
            const bool takes_pw = quality.uv < taken_below_ * quality.pw;
            const bool keeps_uv = quality.pw < kept_below_ * quality.uv;
            const bool is_seen = Sees(u, v, w), is_split = Cross(u, v) == 0;
            is_suspect = is_seen & !takes_pw & !keeps_uv & !is_split;
            suspect->outside = back;
            suspect->quality = quality;
            const bool is_absorbed = (is_seen & takes_pw) | is_split;
            if (options_.measure != FitMeasure::kNormals) [[likely]]
              return is_absorbed;
            if (!std::exchange(is_suspect, false)) return is_absorbed;
            const NormalAngles angles = NormalAnglesOf(q);
            return IsBetterAlongPw(angles.uv, angles.pw, quality);
          },
      [&](std::size_t edge) __attribute__((always_inline)) {
        suspect->edge = static_cast<std::uint32_t>(edge);
        suspect->is_certain = false;
        suspect_count_ += is_suspect;
        is_suspect = false;
        if (suspect_count_ == suspects_.size()) [[unlikely]]
          suspects_.resize(2 * suspect_count_);
        suspect = &suspects_[suspect_count_];
      });
  if (!star.is_closed) [[unlikely]] {
    for (std::size_t i = 0; i < suspect_count_; ++i) {
      suspects_[i].edge =
          static_cast<std::uint32_t>((suspects_[i].edge + star.count - star.split_edge) % (star.count + 1));
    }
  }
  return star;
}

// An angle is weaker evidence for the fit than a distance: with normals the quality is squared once more.
[[gnu::always_inline]] inline ShapeQuality DataDependentCriterion::QualityOf(const Quadrilateral& q) const {
  const ShapeQuality quality = ShapeQualityOf(q);
  if (options_.measure != FitMeasure::kNormals) [[likely]]
    return quality;
  return {quality.uv * quality.uv, quality.pw * quality.pw};
}

// Compares the squared misfits of the two cuts, each divided by its squared quality. If they are equal, the shape
// decides.
inline bool DataDependentCriterion::IsBetterAlongPw(double now, double then, const ShapeQuality& quality) const {
  const bool is_pure = options_.qthresh == 0;
  const double of_uv = now * (is_pure ? 1 : quality.pw), of_pw = then * (is_pure ? 1 : quality.uv);
  return (of_pw < of_uv) | ((of_pw == of_uv) & (quality.pw >= quality.uv));
}

// Scans the outline's triangles and, in the same scan, as many pairs of the suspects as fit.
void DataDependentCriterion::FitOutline(Star& star) {
  MakeRoom(star);
  const std::size_t count = star.count;
  const bool has_border = star.has_border;
  std::size_t end = count + 1, together = 0;
  for (std::size_t i = 0; i < suspect_count_; ++i) {
    Suspect& suspect = suspects_[i];
    suspect.beyond = triangulation_->BeyondOf(suspect.outside, vertex_.position);
    triangulation_->PrefetchAcross(suspect.beyond.uw);
    triangulation_->PrefetchAcross(suspect.beyond.wv);
    if (end > Star::kMaxLeftOut || !fit_errors_.are_maxima()) continue;
    star.left_out |= 1U << (end - 1);
    end = PutPair(star, end, {star.ring[suspect.edge], star.ring[suspect.edge + 1]}, suspect.beyond);
    ++together;
  }
  if (fit_errors_.are_maxima()) {
    star.count = end - 1;
    fit_errors_.Scan(star, misfits_.data(), errors_.data());
    star.count = count;
    star.left_out = 0;
    star.has_border = has_border;
    for (std::size_t i = 0, at = count + 1; i < together; ++i, at += 3) {
      Decide(suspects_[i], &misfits_[at], &errors_[at]);
    }
  } else {
    std::fill_n(errors_.begin(), count, kUnknown);
  }
  if (together < suspect_count_) [[unlikely]]
    FitSuspects(star, together);
}

// Appends u, w and v to a ring of `end` vertices; the two triangles lie between them. The triangle between v and the
// next u is left out. Returns the new end.
inline std::size_t DataDependentCriterion::PutPair(Star& star, std::size_t end, const Ends& ends,
                                                   const Triangulation::Beyond& beyond) const {
  const auto put = [&star](std::size_t at, const RingVertex& vertex) {
    star.ring.dx[at] = vertex.dx;
    star.ring.dy[at] = vertex.dy;
    star.ring.heights[at] = vertex.height;
  };
  put(end, ends.u);
  put(end + 1, beyond.w);
  put(end + 2, ends.v);
  star.has_border |= triangulation_->IsBorder(beyond.uw) | triangulation_->IsBorder(beyond.wv);
  return end + 3;
}

void DataDependentCriterion::FitSuspects(const Star& star, std::size_t first) {
  MakeRoomForPairs();
  if (!fit_errors_.are_maxima()) {
    for (; first < suspect_count_; ++first) FitOneByOne(star, first);
    return;
  }
  pairs_.x = star.x;
  pairs_.y = star.y;
  pairs_.height = star.height;
  pairs_.left_out = kBetweenPairs;
  for (; first < suspect_count_; first += kMaxPairs) {
    const std::size_t pairs = std::min(suspect_count_ - first, kMaxPairs);
    pairs_.has_border = star.has_border;
    std::size_t end = 0;
    for (std::size_t i = 0; i < pairs; ++i) {
      const Suspect& suspect = suspects_[first + i];
      end = PutPair(pairs_, end, EndsOf(star, suspect.edge), suspect.beyond);
    }
    pairs_.count = end - 1;
    fit_errors_.Scan(pairs_, &pair_misfits_[3 * first], &pair_errors_[3 * first]);
    for (std::size_t i = first; i < first + pairs; ++i) {
      Decide(suspects_[i], &pair_misfits_[3 * i], &pair_errors_[3 * i]);
    }
  }
}

void DataDependentCriterion::FitOneByOne(const Star& star, std::size_t index) {
  const Suspect& suspect = suspects_[index];
  const auto [u, v] = EndsOf(star, suspect.edge);
  double* const errors = &pair_errors_[3 * index];
  errors[0] = errors[1] = kUnknown;
  if (!suspect.is_certain) {
    if (double& near = NearError(suspect.edge); near == kUnknown) near = fit_errors_.Of(vertex_, u, v);
    errors[0] = fit_errors_.Of(vertex_, u, suspect.beyond.w);
    errors[1] = fit_errors_.Of(vertex_, suspect.beyond.w, v);
  }
  Decide(suspect, &pair_misfits_[3 * index], errors);
}

// Decides by the fits of (u, w, p) and (w, v, p).
inline void DataDependentCriterion::Decide(const Suspect& suspect, const PlaneMisfit* misfits, const double* errors) {
  const double now = fit_errors_.CombinedSquare(NearError(suspect.edge), ErrorBeyond(suspect.outside / 4));
  const double then = fit_errors_.CombinedSquare(errors[0], errors[1]);
  flips_[flip_count_] = {&suspect, misfits, errors};
  flip_count_ += suspect.is_certain | IsBetterAlongPw(now, then, suspect.quality);
  if (flip_count_ == flips_.size()) [[unlikely]]
    flips_.resize(2 * flip_count_);
}

DataDependentCriterion::Ends DataDependentCriterion::EndsOf(const Star& star, std::uint32_t edge) const {
  if (edge_count_ == 0) return {star.ring[edge], star.ring[edge + 1]};
  return {edges_[edge].u, edges_[edges_[edge].next].u};
}

// Replaces edges round by round, and writes the outline back to the star.
void DataDependentCriterion::ReplaceEdges(Star& star) {
  const auto last = static_cast<std::uint32_t>(star.count);
  if (edges_.size() < last + 2) [[unlikely]]
    edges_.resize(2 * (last + 2));
  for (std::uint32_t i = 0; i < last; ++i) {
    edges_[i] = {star.ring[i], star.outside[i], i + 1, {misfits_[i], errors_[i]}};
  }
  edges_[last].u = star.ring[last];
  edge_count_ = last + 1;
  while (flip_count_ > 0) {
    // The suspects of the previous round are still read.
    suspects_.swap(decided_);
    suspect_count_ = 0;
    for (std::size_t i = 0; i < flip_count_; ++i) ReplaceEdge(star, flips_[i]);
    flip_count_ = 0;
    if (suspect_count_ > 0) FitSuspects(star, 0);
  }
  MakeRoom(star);
  std::size_t count = 0;
  for (std::uint32_t i = 0; i != last; i = edges_[i].next) {
    const Edge& edge = edges_[i];
    star.ring.Put(count, edge.u);
    star.outside[count] = edge.outside;
    misfits_[count] = edge.fit.misfit;
    errors_[count++] = edge.fit.error;
  }
  star.ring.Put(count, edges_[last].u);
  star.count = count;
}

void DataDependentCriterion::ReplaceEdge(Star& star, const Flip& flip) {
  if (edge_count_ == edges_.size()) [[unlikely]]
    edges_.resize(2 * edge_count_);
  const std::uint32_t index = flip.suspect->edge;
  const Triangulation::Beyond& beyond = flip.suspect->beyond;
  Edge& edge = edges_[index];
  const auto made = static_cast<std::uint32_t>(edge_count_++);
  triangulation_->Remove(edge.outside / 4);
  edges_[made] = {beyond.w, beyond.wv, edge.next, {flip.misfits[1], flip.errors[1]}};
  edge.outside = beyond.uw;
  edge.next = made;
  edge.fit = {flip.misfits[0], flip.errors[0]};
  SuspectEdge(star, index);
  SuspectEdge(star, made);
}

// Adds a new edge of the outline as a suspect, unless its shape decides that it stays.
void DataDependentCriterion::SuspectEdge(Star& star, std::uint32_t index) {
  const Edge& edge = edges_[index];
  if (triangulation_->IsBorder(edge.outside)) [[unlikely]] {
    star.has_border = true;
    return;
  }
  const Triangulation::Beyond beyond = triangulation_->BeyondOf(edge.outside, vertex_.position);
  const Quadrilateral q{edge.u, edges_[edge.next].u, beyond.w, vertex_.height};
  const ShapeQuality quality = QualityOf(q);
  // No branch, which would be mispredicted.
  const bool is_suspect = Sees(q.u, q.v, q.w) & !(quality.pw < kept_further_out_below_ * quality.uv);
  suspects_[suspect_count_] = {index, edge.outside, quality.uv < taken_below_ * quality.pw, quality, beyond};
  suspect_count_ += is_suspect;
  if (suspect_count_ == suspects_.size()) [[unlikely]]
    suspects_.resize(2 * suspect_count_);
  for (const HalfEdgeId outside : {beyond.uw, beyond.wv}) {
    triangulation_->PrefetchAcross(outside);
    PrefetchError(outside / 4);
  }
}

// Relative to the triangle's last corner, as in the scan of its star, so that rounding is equal.
inline double DataDependentCriterion::ErrorBeyond(TriangleId t) {
  if (errors_by_slot_[t] == kUnknown) [[unlikely]] {
    const auto [a, b, c] = triangulation_->triangle(t);
    const Triangulation::Vertex p{triangulation_->position(c), triangulation_->height(c)};
    const auto seen = [&](VertexId corner) { return triangulation_->Seen(corner, p.position); };
    errors_by_slot_[t] = fit_errors_.Of(p, seen(a), seen(b));
  }
  return errors_by_slot_[t];
}

// At the border the address is arbitrary, which is harmless.
[[gnu::always_inline]] inline void DataDependentCriterion::PrefetchError(TriangleId t) const {
  const auto errors = reinterpret_cast<std::uintptr_t>(errors_by_slot_.data());
  __builtin_prefetch(reinterpret_cast<const void*>(errors + sizeof(double) * t));
}

const PlaneMisfit* DataDependentCriterion::Scan(const Star& star) {
  if (fit_errors_.are_maxima() && star.centre == centre_ && star.count == count_) return misfits_.data();
  MakeRoom(star);
  fit_errors_.Scan(star, misfits_.data(), errors_.data());
  count_ = 0;
  if (!fit_errors_.are_maxima()) return misfits_.data();
  CoverSlots();
  for (std::size_t i = 0; i < star.count; ++i) errors_by_slot_[star.triangles[i]] = errors_[i];
  return misfits_.data();
}

void DataDependentCriterion::MakeRoomForPairs() {
  const std::size_t room = 3 * suspect_count_ + FitErrors::kPadding;
  if (pair_misfits_.size() >= room) return;
  pair_misfits_.resize(2 * room);
  pair_errors_.resize(2 * room);
}

void DataDependentCriterion::MakeRoom(const Star& star) {
  const std::size_t room = star.ring.capacity() + FitErrors::kPadding;
  if (misfits_.size() >= room) return;
  misfits_.resize(room);
  errors_.resize(room);
}

inline void DataDependentCriterion::CoverSlots() {
  const std::size_t slots = triangulation_->triangle_count();
  if (errors_by_slot_.size() < slots) [[unlikely]]
    errors_by_slot_.GrowTo(slots + kSpareSlots, kUnknown);
}

}  // namespace terrace::tin

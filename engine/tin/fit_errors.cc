#include "engine/tin/fit_errors.h"

#include <array>

#include "engine/tin/border.h"
#include "engine/tin/mesh/plane.h"
#include "engine/tin/scan/squared_distances.h"

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

void FitErrors::AddBordersAndSagitta(const Star& star, const PlaneMisfit* misfits, double* errors) const {
  const Triangulation::Vertex p{{static_cast<std::uint16_t>(star.x), static_cast<std::uint16_t>(star.y)}, star.height};
  for (std::size_t i = 0; i < star.count; ++i) {
    if (!star.IsLeftOut(i)) errors[i] = Of(misfits[i], p, star.ring[i], star.ring[i + 1]);
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

}  // namespace terrace::tin

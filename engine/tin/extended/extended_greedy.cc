#include "engine/tin/extended/extended_greedy.h"

#include <array>
#include <cmath>
#include <cstdint>

#include "engine/tin/scan/triangle_rows.h"

namespace terrace::tin {
namespace {

// Insertions between two checks of the stop token: well below a millisecond.
constexpr std::size_t kExtendedStopPeriod = 256;

// A triangle's planes of z, r, g and b, relative to its last corner p and multiplied by D, twice its area. A sample at
// (x, y) from p differs from channel c by |D (c - c_p) - (a x + b y)| / D. For colours this is exact: D < 2^30, |x|,
// |y| < 2^15, |a|, |b| < 2^24.
class Planes {
 public:
  struct Corner {
    SamplePosition position;
    double z;
    Rgb color;
  };

  Planes(const Corner& u, const Corner& v, const Corner& p)
      : p_(p),
        ux_(u.position.x - p.position.x),
        uy_(u.position.y - p.position.y),
        vx_(v.position.x - p.position.x),
        vy_(v.position.y - p.position.y),
        d_(ux_ * vy_ - uy_ * vx_),
        z_(Of(u.z - p.z, v.z - p.z)) {
    for (std::size_t i = 0; i < 3; ++i) colors_[i] = Of(u.color[i] - p.color[i], v.color[i] - p.color[i]);
  }

  // The plane's colour at a sample inside the triangle, to the nearest level.
  Rgb ColorAt(SamplePosition sample) const {
    const double x = sample.x - p_.position.x, y = sample.y - p_.position.y;
    Rgb color;
    for (std::size_t i = 0; i < 3; ++i) {
      color[i] = static_cast<std::uint8_t>(std::floor(p_.color[i] + (colors_[i].a * x + colors_[i].b * y) / d_ + 0.5));
    }
    return color;
  }

  // The combined error of a sample; NaN at a void.
  double Error(const ExtendedField& field, double x, double y, float z, const Rgba& color) const {
    double levels = 0;
    if (ExtendedField::IsKnown(color)) {
      for (std::size_t i = 0; i < 3; ++i) levels += Numerator(color[i], p_.color[i], colors_[i], x, y);
    }
    return field.Error(Numerator(static_cast<double>(z), p_.z, z_, x, y), levels) / d_;
  }

 private:
  struct Slopes {
    double a = 0, b = 0;  // times D, per column and row
  };

  Slopes Of(double u, double v) const { return {vy_ * u - uy_ * v, ux_ * v - vx_ * u}; }
  double Numerator(double value, double at_p, const Slopes& slopes, double x, double y) const {
    return std::abs(d_ * (value - at_p) - (slopes.a * x + slopes.b * y));
  }

  Corner p_;
  double ux_, uy_, vx_, vy_;  // of u and v, from p
  double d_;
  Slopes z_;
  std::array<Slopes, 3> colors_;
};

Planes PlanesOf(const Triangulation& triangulation, const std::vector<Rgb>& colors, TriangleId t) {
  const auto corner = [&](VertexId vertex) -> Planes::Corner {
    return {triangulation.position(vertex), static_cast<double>(triangulation.height(vertex)), colors[vertex]};
  };
  const auto [u, v, p] = triangulation.triangle(t);
  return {corner(u), corner(v), corner(p)};
}

}  // namespace

ExtendedGreedy::ExtendedGreedy(const ExtendedField& field) : field_(&field), triangulation_(field.heights()) {
  for (VertexId vertex = 0; vertex < 4; ++vertex) {
    const auto [x, y] = triangulation_.position(vertex);
    const Rgba& color = field.ColorAt(x, y);
    colors_.push_back(ExtendedField::IsKnown(color) ? Rgb{color[0], color[1], color[2]} : field.NearestColor(x, y));
  }
  Scan(0);
  Scan(1);
}

bool ExtendedGreedy::Run(const ExtendedGoal& goal, std::stop_token stop) {
  for (std::size_t count = 0;; ++count) {
    if (count % kExtendedStopPeriod == 0 && stop.stop_requested()) return false;
    if (vertex_count() >= goal.max_points) return true;
    const TriangleId worst = candidates_.Winner();
    if (worst == CandidateQueue::kNoSlot || static_cast<double>(candidates_.error(worst)) <= goal.max_error)
      return true;
    Insert(worst);
  }
}

double ExtendedGreedy::CurrentError() {
  const TriangleId worst = candidates_.Winner();
  return worst == CandidateQueue::kNoSlot ? 0 : static_cast<double>(candidates_.error(worst));
}

void ExtendedGreedy::Insert(TriangleId triangle) {
  const SamplePosition sample = PositionOf(candidates_.sample(triangle));
  colors_.push_back(ColorOfVertex(sample, triangle));
  const Star& star = triangulation_.InsertDelaunay({sample, field_->heights().At(sample.x, sample.y)}, triangle);
  for (std::size_t i = 0; i < star.count; ++i) Scan(star.triangles[i]);
}

Rgb ExtendedGreedy::ColorOfVertex(SamplePosition sample, TriangleId triangle) const {
  const Rgba& color = field_->ColorAt(sample.x, sample.y);
  if (ExtendedField::IsKnown(color)) return {color[0], color[1], color[2]};
  return PlanesOf(triangulation_, colors_, triangle).ColorAt(sample);
}

void ExtendedGreedy::Scan(TriangleId t) {
  const auto [u, v, p] = triangulation_.triangle(t);
  const std::array<SamplePosition, 3> corners = {triangulation_.position(u), triangulation_.position(v),
                                                 triangulation_.position(p)};
  const auto is_corner = [&](int x, int y) {
    return (x == corners[0].x && y == corners[0].y) || (x == corners[1].x && y == corners[1].y) ||
           (x == corners[2].x && y == corners[2].y);
  };
  const Planes planes = PlanesOf(triangulation_, colors_, t);
  Candidate worst;
  ForEachRow(corners, [&](int y, int first, int last) {
    // Vertices, which may have a rounding error, are no candidates. They are the ends of their rows.
    if (first <= last && is_corner(first, y)) ++first;
    if (first <= last && is_corner(last, y)) --last;
    const float* heights = field_->heights().Row(y);
    const Rgba* colors = field_->ColorRow(y);
    for (int x = first; x <= last; ++x) {
      const double error = planes.Error(*field_, x - corners[2].x, y - corners[2].y, heights[x], colors[x]);
      if (!(error > worst.error)) continue;  // also at a void; numbers ascend, so the first of equals stays
      worst = {error, SampleNumber(x, y)};
    }
  });
  candidates_.Set(t, worst);
}

}  // namespace terrace::tin

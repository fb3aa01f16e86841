#include "tests/engine/tin/naive_greedy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "engine/core/check.h"
#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/candidate_queue.h"
#include "engine/tin/mesh/plane.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh/triangulation.h"

namespace terrace::tin {
namespace {

struct Pick {
  Candidate candidate;
  TriangleId triangle = 0;
};

class NaivePass {
 public:
  NaivePass(const HeightField& field, const std::array<BorderOptions, 4>& borders, const Triangulation& triangulation)
      : field_(field), borders_(borders), triangulation_(triangulation) {}

  Pick WorstOfAll() {
    Pick pick;
    for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) {
      worst_ = {};
      for (int y = 0; y < field_.height(); ++y) {
        for (int x = 0; x < field_.width(); ++x) Judge(t, x, y);
      }
      // Triangles are compared by errors rounded to float, samples of one triangle by their exact ones.
      worst_.error = static_cast<double>(CandidateQueue::RoundUp(worst_.error));
      if (Precedes(worst_, pick.candidate)) pick = {worst_, t};
    }
    return pick;
  }

 private:
  Corner CornerAt(SamplePosition p) const { return {p.x, p.y, static_cast<double>(field_.VertexHeight(p.x, p.y))}; }

  void Judge(TriangleId t, int x, int y) {
    const SamplePosition p{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
    std::array<SamplePosition, 3> corners;
    for (unsigned i = 0; i < 3; ++i) corners[i] = triangulation_.position(triangulation_.triangle(t)[i]);
    for (unsigned i = 0; i < 3; ++i) {
      if (p == corners[i] || Orientation(corners[i], corners[(i + 1) % 3], p) < 0) return;
    }
    const bool on_border = x == 0 || y == 0 || x == field_.width() - 1 || y == field_.height() - 1;
    const double error = on_border ? BorderErrorOf(corners, p) : PlaneErrorOf(corners, p);
    const Candidate candidate{error, SampleNumber(x, y)};
    if (error > 0 && Precedes(candidate, worst_)) worst_ = candidate;  // false for NaN
  }

  // The formula of triangle_scan.h, relative to the last inserted corner.
  double PlaneErrorOf(const std::array<SamplePosition, 3>& corners, SamplePosition sample) const {
    const Corner u = CornerAt(corners[0]), v = CornerAt(corners[1]), p = CornerAt(corners[2]);
    const double ux = u.x - p.x, uy = u.y - p.y, uz = u.z - p.z, vx = v.x - p.x, vy = v.y - p.y, vz = v.z - p.z;
    const double d = ux * vy - uy * vx, a = vy * uz - uy * vz, b = ux * vz - vx * uz;
    const double height = static_cast<double>(field_.At(sample.x, sample.y));
    return std::abs(d * (height - p.z) - (a * (sample.x - p.x) + b * (sample.y - p.y))) / d;
  }

  // p is on the border and in the triangle, and not a corner, so it is on the edge that is collinear with it.
  double BorderErrorOf(const std::array<SamplePosition, 3>& corners, SamplePosition p) const {
    for (unsigned i = 0; i < 3; ++i) {
      SamplePosition low = corners[i], high = corners[(i + 1) % 3];
      if (Orientation(low, high, p) != 0) continue;
      if (high.x < low.x || high.y < low.y) std::swap(low, high);
      const bool along_x = low.y == high.y;
      const Side side = along_x ? (p.y == 0 ? Side::kSouth : Side::kNorth) : (p.x == 0 ? Side::kWest : Side::kEast);
      const BorderOptions& options = borders_[static_cast<std::size_t>(side)];
      const int a = along_x ? low.x : low.y, b = along_x ? high.x : high.y, k = along_x ? p.x : p.y;
      const double h_a = CornerAt(low).z, h_b = CornerAt(high).z, h_k = static_cast<double>(field_.At(p.x, p.y));
      const double error =
          std::abs((h_a * (b - k) + h_b * (k - a)) / (b - a) - h_k) + options.sagitta_m * (k - a) * (b - k);
      return BorderError(error, options);
    }
    CheckFailed("a border sample lies on a border edge", __FILE__, __LINE__);
  }

  const HeightField& field_;
  const std::array<BorderOptions, 4>& borders_;
  const Triangulation& triangulation_;
  Candidate worst_;  // of the current triangle
};

}  // namespace

double BorderError(double misfit_m, const BorderOptions& options) {
  const double padded = misfit_m + options.padding_m;
  return options.scale *
         std::min(std::max(padded * options.weight, padded + options.step_m), kMaxBorderWeight * misfit_m);
}

TinMesh NaiveGreedy(const HeightField& field, const std::array<BorderOptions, 4>& borders, const GreedyGoal& goal) {
  Triangulation triangulation(field);
  while (triangulation.vertex_count() < goal.max_points) {
    const Pick worst = NaivePass(field, borders, triangulation).WorstOfAll();
    if (worst.candidate.error <= goal.max_error) break;
    const SamplePosition sample = PositionOf(worst.candidate.sample);
    triangulation.InsertDelaunay(Triangulation::VertexAt(field, sample.x, sample.y), worst.triangle);
  }
  return triangulation.Mesh();
}

}  // namespace terrace::tin

#include "tests/bench/parallel_insertion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/bench/triangle_samples.h"

namespace terrace::bench {

using tin::Candidate;
using tin::TriangleId;

ParallelInsertion::ParallelInsertion(const tin::HeightField& field)
    : field_(field), triangulation_(field), changed_{0, 1} {
  ScanChanged();
}

std::size_t ParallelInsertion::FractionalPass(double alpha, std::size_t max_points) {
  return Pass(alpha * CurrentError(), max_points);
}

std::size_t ParallelInsertion::ConstantPass(double epsilon, std::size_t max_points) {
  return Pass(epsilon, max_points);
}

std::size_t ParallelInsertion::NaivePass(std::size_t max_points) {
  for (TriangleId t = 0; t < triangulation_.triangle_count(); ++t) changed_.push_back(t);
  ScanChanged();
  return FractionalPass(1, max_points);
}

std::size_t ParallelInsertion::Pass(double threshold, std::size_t max_points) {
  std::vector<Candidate> chosen;
  for (const Candidate& candidate : candidates_) {
    if (candidate.error > 0 && candidate.error >= threshold) chosen.push_back(candidate);
  }
  std::sort(chosen.begin(), chosen.end(), [](const Candidate& a, const Candidate& b) { return Precedes(a, b); });
  std::size_t inserted = 0;
  for (const Candidate& candidate : chosen) {
    if (vertex_count() >= max_points) break;
    if (Insert(candidate)) ++inserted;
  }
  ScanChanged();
  return inserted;
}

// Returns false if the sample is already a vertex: the triangles on both sides of an edge may have the same candidate.
bool ParallelInsertion::Insert(const Candidate& candidate) {
  const tin::SamplePosition point = tin::PositionOf(candidate.sample);
  const TriangleId start = changed_.empty() ? 0 : changed_.back();
  const TriangleId triangle = triangulation_.Locate(point, start);
  if (triangulation_.IsCorner(point, triangle)) return false;
  const tin::Star& star =
      triangulation_.InsertDelaunay(tin::Triangulation::VertexAt(field_, point.x, point.y), triangle);
  changed_.insert(changed_.end(), star.triangles.begin(),
                  star.triangles.begin() + static_cast<std::ptrdiff_t>(star.count));
  return true;
}

void ParallelInsertion::ScanChanged() {
  std::sort(changed_.begin(), changed_.end());
  changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
  candidates_.resize(triangulation_.triangle_count());
  for (const TriangleId t : changed_) candidates_[t] = WorstOf(t);
  changed_.clear();
}

Candidate ParallelInsertion::WorstOf(TriangleId t) const {
  std::array<tin::SamplePosition, 3> corners;
  for (unsigned i = 0; i < 3; ++i) corners[i] = triangulation_.position(triangulation_.triangle(t)[i]);
  Candidate worst;
  ForEachSample(field_, corners, [&](tin::SamplePosition p, double height) {
    const Candidate candidate{std::abs(height - static_cast<double>(field_.At(p.x, p.y))), tin::SampleNumber(p.x, p.y)};
    const bool is_corner = std::find(corners.begin(), corners.end(), p) != corners.end();
    if (!is_corner && candidate.error > 0 && Precedes(candidate, worst)) worst = candidate;  // false for NaN
  });
  return worst;
}

double ParallelInsertion::CurrentError() const {
  double error = 0;
  for (const Candidate& candidate : candidates_) error = std::max(error, candidate.error);
  return error;
}

tin::TinMesh ParallelInsertion::Mesh() const { return triangulation_.Mesh(); }

}  // namespace terrace::bench

// Greedy insertion of many samples in each pass: section 4.4 of the paper, the variant it advises against.
//
// Every triangle has its worst sample as a candidate. A pass inserts the candidates of all triangles at once that reach
// a threshold, and only then looks at the triangles that changed. The threshold is `alpha` times the largest error at
// the start of the pass (fractional), or a constant `epsilon`. alpha = 1 is sequential insertion but for ties, alpha =
// 0 inserts a sample in every triangle.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/tin/mesh/candidate.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/mesh/triangulation.h"

namespace terrace::bench {

class ParallelInsertion {
 public:
  // `field` must outlive this object.
  explicit ParallelInsertion(const tin::HeightField& field);

  // One pass; returns how many samples it inserted, 0 when there is none left that reaches the threshold. Stops in the
  // middle of the pass at `max_points` vertices.
  std::size_t FractionalPass(double alpha, std::size_t max_points);
  std::size_t ConstantPass(double epsilon, std::size_t max_points);

  // A pass of section 3.2, algorithm I: looks at every sample of the field again and inserts the worst. O(n) each.
  std::size_t NaivePass(std::size_t max_points);

  std::size_t vertex_count() const { return triangulation_.vertex_count(); }
  double CurrentError() const;
  tin::TinMesh Mesh() const;

 private:
  std::size_t Pass(double threshold, std::size_t max_points);
  bool Insert(const tin::Candidate& candidate);
  void ScanChanged();
  tin::Candidate WorstOf(tin::TriangleId t) const;

  const tin::HeightField& field_;
  tin::Triangulation triangulation_;
  std::vector<tin::Candidate> candidates_;  // by triangle
  std::vector<tin::TriangleId> changed_;    // since they were scanned, some of them more than once
};

}  // namespace terrace::bench

// Greedy insertion of many samples in each pass: section 4.4 of the paper, which advises against it. The candidate of
// a triangle is its worst sample. A pass inserts all candidates that reach a threshold, and scans the changed triangles
// only afterwards. The threshold is `alpha` times the largest error at the start of the pass (fractional), or a
// constant `epsilon`. alpha = 1 is sequential insertion except for ties. alpha = 0 inserts a sample in every triangle.
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

  // Runs one pass. Returns the number of inserted samples, 0 if none reaches the threshold. Stops during the pass at
  // `max_points` vertices.
  std::size_t FractionalPass(double alpha, std::size_t max_points);
  std::size_t ConstantPass(double epsilon, std::size_t max_points);

  // A pass of section 3.2, algorithm I: scans every sample of the field again and inserts the worst. O(n).
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
  std::vector<tin::TriangleId> changed_;    // since their last scan, with duplicates
};

}  // namespace terrace::bench

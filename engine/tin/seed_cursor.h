// The position of a run within its seed grids: the samples that are due, in order.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/candidate_queue.h"
#include "engine/tin/mesh/height_field.h"

namespace terrace::tin {

class SeedCursor {
 public:
  // Fails a TERRACE_CHECK if a step does not divide both sides, or if the grids are not in order of decreasing
  // below_error.
  SeedCursor(const HeightField& field, std::vector<SeedGrid> grids);

  // Whether a grid is unfinished. Its remaining samples are inserted at any error.
  bool InGrid() const { return begun_; }
  bool HasGrid() const { return grid_ < grids_.size(); }
  // Whether the next grid must be in every mesh with this error. Precondition: HasGrid.
  bool IsDue(double error) const { return static_cast<double>(below_error()) > error; }
  // The below_error of the grid that holds the next sample, rounded up to a float.
  float below_error() const { return CandidateQueue::RoundUp(grids_[grid_].below_error); }

  // The next sample, row by row. Precondition: HasGrid.
  SamplePosition Take();

 private:
  int width_, height_;
  std::vector<SeedGrid> grids_;
  std::size_t grid_ = 0;
  bool begun_ = false;
  int x_ = 0, y_ = 0;
};

}  // namespace terrace::tin

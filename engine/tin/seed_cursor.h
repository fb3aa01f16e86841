// Where a run is in its seed grids: which samples are due, in which order.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/candidate_queue.h"
#include "engine/tin/mesh/height_field.h"

namespace terrace::tin {

class SeedCursor {
 public:
  // TERRACE_CHECKs what SeedGrid promises: steps that divide both sides, in order of decreasing below_error.
  SeedCursor(const HeightField& field, std::vector<SeedGrid> grids);

  // A grid that has been begun is taken to its end, whatever the error becomes meanwhile.
  bool InGrid() const { return begun_; }
  bool HasGrid() const { return grid_ < grids_.size(); }
  // Whether the next grid must be in every mesh with this error. Precondition: HasGrid.
  bool IsDue(double error) const { return static_cast<double>(below_error()) > error; }
  // Of the grid that the next sample is from, rounded up.
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

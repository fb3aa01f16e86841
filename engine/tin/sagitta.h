// How far a flat triangle cuts below curved ground: computes the bound that Curvature in greedy.h defines.
#pragma once

#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class Sagitta {
 public:
  // Fails a TERRACE_CHECK if `curvature` is not valid for a field of `rows` rows.
  Sagitta(Curvature curvature, int rows);

  bool is_flat() const { return east_m2_.empty(); }

  // Metres; 0 for flat ground. Corners in any order, not on one line.
  double Bound(SamplePosition a, SamplePosition b, SamplePosition c) const;

 private:
  std::vector<double> east_m2_;
  double north_m2_;
  double doubled_radius_;
  int widest_row_ = 0;
};

}  // namespace terrace::tin

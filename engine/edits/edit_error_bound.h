// The certified error of edited heights (docs/decisions/0022-edits.md).
//
// Let S be the surface that is bilinear between nodes of heights s, h a sample of the sources, and e a bound of |S - h|
// in a cell. An edit with the weight w and the target t makes s' = s + w (t - s) of nodes and of samples alike. With
// the weight between w0 and w1 in the cell, d the largest |t - s| at its nodes, and tau a bound of the distance between
// the target and its bilinear surface,
//   S' - h' = (1 - w)(S - h) + bilinear((w_node - w)(t - s)) + w (bilinear(t) - t)
//   |S' - h'| <= (1 - w0) e + (w1 - w0) d + w1 tau.
// For offsets, where t - s is constant, for carving and for raising, e is not reduced: the first term is e. For carving
// and raising max(0, +-(s - t)) takes the place of t - s; where s - t changes its sign in the cell, w1 d is added.
// Where a replacement has no height at a corner of the cell, or voids in it, w0 is 0, because samples may keep their
// heights. At such a corner w_node is 0, and t is the assumed target, which is not s where an earlier edit changed s.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/edits/edit.h"
#include "engine/edits/edit_shape.h"

namespace terrace::dem {

// Another source's heights at the nodes of a window; NaN where it has none.
struct ReplacementHeights {
  std::vector<float> heights;
  // A bound of the distance between the source's samples and the surface through these heights. At nodes with NaN the
  // surface has the height before all edits.
  double error_m = 0;
  // By cell of the window, row by row from the south: 1 where samples of the source may be voids. Empty: nowhere.
  std::vector<std::uint8_t> void_cells = {};
};

// A node as an edit finds it.
struct EditedNode {
  EditPlace place;
  double height = 0;  // before the edit
  double target = 0;  // NaN: unknown, the weight is 0
  // If the target of a replacement is unknown: the height before all edits, which ReplacementHeights::error_m assumes.
  double assumed_target = 0;
};

class EditErrorBound {
 public:
  // `window`: of a tile with a halo of one. `error_m`: the bound before the edits.
  EditErrorBound(const NodeWindow& window, double error_m);

  // `part`: the nodes, relative to the window. `diagonal_m`: of a cell. `replacement`: of a `replace`, else null.
  void Add(const Edit& edit, const NodeWindow& part, std::span<const EditedNode> nodes, double diagonal_m,
           const ReplacementHeights* replacement);

  double bound() const;

 private:
  NodeWindow window_;
  double before_;
  std::vector<double> cells_;  // by cell of the window; negative: before_
};

}  // namespace terrace::dem

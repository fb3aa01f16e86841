#include "engine/edits/edit_error_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace terrace::dem {
namespace {

// A bound on the distance between the target and the surface through its values at the nodes of a cell. Beyond a
// polygon the target is that of the nearest point of the outline. The nearest points of a convex outline are no further
// apart than the points themselves.
double TargetError(const Edit& edit, double diagonal_m, double furthest_m) {
  if (edit.op == EditOp::kOffset) return 0;
  const double range = edit.high_m - edit.low_m;  // of flatten: of the geoid
  if (edit.is_convex) return std::min(range, 2 * edit.steepest * diagonal_m);
  if (edit.is_area && edit.triangles.empty()) {
    return std::min(range, 2 * edit.steepest * (diagonal_m + 2 * furthest_m));
  }
  return range;
}

}  // namespace

EditErrorBound::EditErrorBound(const NodeWindow& window, double error_m) : window_(window), before_(error_m) {
  cells_.assign(Area(window.columns - 1, window.rows - 1), -1);
}

void EditErrorBound::Add(const Edit& edit, const NodeWindow& part, std::span<const EditedNode> nodes, double diagonal_m,
                         const ReplacementHeights* replacement) {
  const auto stride = static_cast<std::size_t>(part.columns);
  for (int j = 0; j + 1 < part.rows; ++j) {
    for (int i = 0; i + 1 < part.columns; ++i) {
      const std::size_t at = IndexAt(i, j, part.columns);
      const std::array<const EditedNode*, 4> corners = {&nodes[at], &nodes[at + 1], &nodes[at + stride],
                                                        &nodes[at + stride + 1]};
      double nearest = std::numeric_limits<double>::infinity(), furthest = -nearest, difference = 0;
      const std::size_t cell = IndexAt(part.column + i, part.row + j, window_.columns - 1);
      bool is_above = false, is_below = false;
      bool is_partial =
          replacement != nullptr && !replacement->void_cells.empty() && replacement->void_cells[cell] != 0;
      for (const EditedNode* node : corners) {
        const double distance = node->place.is_inside ? -node->place.depth_m : node->place.distance_m;
        nearest = std::min(nearest, distance);
        furthest = std::max(furthest, distance);
        const double low = std::isnan(node->target) ? edit.low_m : node->target;
        const double high = std::isnan(node->target) ? edit.high_m : node->target;
        const bool is_unknown = edit.op == EditOp::kReplace && std::isnan(node->target);
        is_partial |= is_unknown;
        if (edit.op == EditOp::kOffset) {
          difference = std::abs(edit.offset_m);
        } else if (is_unknown) {
          difference = std::max(difference, std::abs(node->height - node->assumed_target));
        } else {
          difference = std::max({difference, std::abs(node->height - low), std::abs(node->height - high)});
        }
        is_above |= node->height > low;
        is_below |= node->height < high;
      }
      // A distance changes by at most the length of a move, and each point of the cell is within half a diagonal of a
      // node.
      const double high_weight = edit.WeightAt(std::max(nearest - diagonal_m / 2, 0.0));
      const double low_weight = is_partial ? 0 : edit.WeightAt(furthest + diagonal_m / 2);
      if (high_weight <= 0) continue;
      double& error = cells_[cell];
      const double before = error < 0 ? before_ : error;
      const double tau = replacement != nullptr
                             ? replacement->error_m
                             : TargetError(edit, diagonal_m, std::max(furthest, 0.0) + diagonal_m / 2);
      const bool one_way = edit.op == EditOp::kCarve || edit.op == EditOp::kRaise;
      const double kept = one_way || edit.op == EditOp::kOffset ? 1 : 1 - low_weight;
      error = kept * before + (high_weight - low_weight) * difference + high_weight * tau;
      if (one_way && is_above && is_below) error += high_weight * difference;
    }
  }
}

double EditErrorBound::bound() const {
  constexpr double kRounding = 0x1p-10;  // of edited heights, and of the arithmetic
  double largest = before_;
  for (int j = 1; j + 2 < window_.rows; ++j) {  // without the halo's cells
    for (int i = 1; i + 2 < window_.columns; ++i) {
      largest = std::max(largest, cells_[IndexAt(i, j, window_.columns - 1)]);
    }
  }
  return largest + kRounding;
}

}  // namespace terrace::dem

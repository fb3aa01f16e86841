#include "engine/edits/edit_set.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "engine/edits/edit_error_bound.h"
#include "engine/edits/edit_shape.h"
#include "engine/edits/edit_window.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {
namespace {

BoxIndex IndexOfEdits(const std::vector<Edit>& edits) {
  std::vector<BoxIndex::Entry> entries;
  entries.reserve(3 * edits.size());
  for (std::size_t i = 0; i < edits.size(); ++i) {
    const Box& box = edits[i].reach;
    for (const int turn : {-360, 0, 360})
      entries.push_back({{box.min_x + turn, box.min_y, box.max_x + turn, box.max_y}, i});
  }
  return BoxIndex(entries);
}

// The last box of a thread without edits.
struct EmptyBox {
  std::uint64_t set = 0;
  Box box;

  bool Contains(std::uint64_t number, const Box& degrees) const {
    return set == number && degrees.min_x >= box.min_x && degrees.max_x <= box.max_x && degrees.min_y >= box.min_y &&
           degrees.max_y <= box.max_y;
  }
};
thread_local EmptyBox last_empty;

// Whether an edit's target has to be converted to the heights' datum.
bool IsConverted(const Edit& edit, const EditedDatum& datum) { return edit.TargetDatum(datum.datum) != datum.datum; }

// The edited height. `target`: NaN where a replacement has none.
double Edited(EditOp op, double height, double target, double weight) {
  switch (op) {
    case EditOp::kOffset:
      return height + weight * target;
    case EditOp::kCarve:
      return height - weight * std::max(height - target, 0.0);
    case EditOp::kRaise:
      return height + weight * std::max(target - height, 0.0);
    default:
      return weight == 1 ? target : height + weight * (target - height);
  }
}

}  // namespace

EditSet::EditSet(std::vector<Edit> edits) : edits_(std::move(edits)), index_(IndexOfEdits(edits_)) {
  static std::atomic<std::uint64_t> sets{0};
  number_ = ++sets;
}

std::vector<std::size_t> EditSet::Find(const Box& degrees) const {
  if (last_empty.Contains(number_, degrees)) return {};
  std::vector<std::size_t> found = index_.Find(degrees);
  if (found.empty()) last_empty = {number_, degrees};
  return found;
}

bool EditSet::Any(const Box& degrees) const {
  if (last_empty.Contains(number_, degrees)) return false;
  if (index_.Any(degrees)) return true;
  last_empty = {number_, degrees};
  return false;
}

Result<void> EditSet::Apply(const geo::NodeGrid& grid, const NodeWindow& window, std::span<const std::size_t> which,
                            const EditedDatum& datum, std::span<float> heights, const ReadReplacement& replacement,
                            const std::stop_token& stop, double* error_m) const {
  if (which.empty()) return {};
  const WindowAxes axes(grid, window);
  const auto stride = static_cast<std::size_t>(window.columns);
  std::vector<double> values(heights.begin(), heights.end());
  std::optional<EditErrorBound> errors;
  if (error_m != nullptr) errors.emplace(window, *error_m);
  for (const std::size_t index : which) {
    const Edit& edit = edits_[index];
    if (!edit.changes_heights()) continue;
    const ReplacementHeights* other = nullptr;
    if (edit.op == EditOp::kReplace) {
      auto read = replacement(edit);
      if (!read) return tl::unexpected(std::move(read).error());
      other = *read;
    }
    const bool converts = IsConverted(edit, datum);
    const double diagonal_m = std::hypot(axes.step() * edit.plane.east_m, axes.step() * edit.plane.north_m);
    for (const auto& part : axes.PartsOf(edit.reach)) {
      const int columns = part.last_column - part.first_column + 1;
      std::vector<EditedNode> nodes;
      if (errors) nodes.resize(Area(columns, part.last_row - part.first_row + 1));
      for (int j = part.first_row; j <= part.last_row; ++j) {
        if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "stopped");
        const double y = edit.plane.Y(axes.latitude(j));
        const EditRow row(edit, y, errors ? diagonal_m / 2 : 0);
        for (int i = part.first_column; i <= part.last_column; ++i) {
          const double x = edit.plane.X(axes.longitude(i));
          const EditPlace place = row.At(x);
          const double weight = edit.WeightAt(place.distance_m);
          const std::size_t at = static_cast<std::size_t>(j) * stride + static_cast<std::size_t>(i);
          double target = std::numeric_limits<double>::quiet_NaN();
          if (edit.op == EditOp::kOffset) {
            target = edit.offset_m;
          } else if (edit.op == EditOp::kReplace) {
            target = static_cast<double>(other->heights[at]);
          } else if (weight > 0) {
            target = row.TargetAt(x, place, datum.datum);
          }
          const double undulation = converts ? datum.undulations[at] : 0;
          target -= undulation;
          if (errors) {
            nodes[IndexAt(i - part.first_column, j - part.first_row, columns)] = {place, values[at], target,
                                                                                  heights[at] - undulation};
          }
          if (weight > 0 && !std::isnan(target)) values[at] = Edited(edit.op, values[at], target, weight);
        }
      }
      if (errors) {
        errors->Add(edit, {part.first_column, part.first_row, columns, part.last_row - part.first_row + 1}, nodes,
                    diagonal_m, other);
      }
    }
  }
  for (std::size_t k = 0; k < values.size(); ++k) heights[k] = RoundHeight(values[k]);
  if (errors) *error_m = errors->bound();
  return {};
}

double EditSet::ApplyAt(const GeoPosition& position, std::span<const std::size_t> which, const EditedDatum& datum,
                        double height, const std::function<double(const Edit&)>& replacement, EditRows& rows) const {
  bool is_in_hole = false;  // as of tiles, whatever other edits say
  for (const std::size_t index : which) {
    const Edit& edit = edits_[index];
    if (!edit.changes_heights() && edit.op != EditOp::kHole) continue;
    const PlanPoint point{edit.plane.X(position.longitude), edit.plane.Y(position.latitude)};
    auto row = rows.find(index);
    if (row != rows.end() && row->second.y() != point.y) {
      rows.erase(row);
      row = rows.end();
    }
    if (row == rows.end()) row = rows.emplace(index, EditRow(edit, point.y)).first;
    const EditPlace place = row->second.At(point.x);
    const double weight = edit.WeightAt(place.distance_m);
    if (weight <= 0) continue;
    if (edit.op == EditOp::kHole) {
      is_in_hole = true;
      continue;
    }
    double target = edit.op == EditOp::kOffset    ? edit.offset_m
                    : edit.op == EditOp::kReplace ? replacement(edit)
                                                  : row->second.TargetAt(point.x, place, datum.datum);
    if (IsConverted(edit, datum)) target -= datum.undulations.front();
    if (!std::isnan(target)) height = Edited(edit.op, height, target, weight);
  }
  if (is_in_hole) return std::numeric_limits<double>::quiet_NaN();
  return std::isnan(height) ? height : static_cast<double>(RoundHeight(height));
}

HeightRange EditSet::Extended(HeightRange range, std::span<const std::size_t> which,
                              const std::function<HeightRange(const Edit&)>& replacement) const {
  for (const std::size_t index : which) {
    const Edit& edit = edits_[index];
    if (!edit.changes_heights()) continue;
    if (edit.op == EditOp::kOffset) {
      range.min += std::min(edit.offset_m, 0.0);
      range.max += std::max(edit.offset_m, 0.0);
      continue;
    }
    const HeightRange target = edit.op == EditOp::kReplace ? replacement(edit) : HeightRange{edit.low_m, edit.high_m};
    // Carving only lowers, raising only raises.
    if (edit.op != EditOp::kRaise) range.min = std::min(range.min, target.min);
    if (edit.op != EditOp::kCarve) range.max = std::max(range.max, target.max);
  }
  // Heights are rounded to multiples of 2^-10 m.
  return {std::floor(range.min * 1024) / 1024, std::ceil(range.max * 1024) / 1024};
}

void ForNodesAlong(const geo::Lattice& lattice, const NodeWindow& window, const EditPlane& plane, PlanPoint a,
                   PlanPoint b, const std::function<void(std::int64_t, std::int64_t)>& visit) {
  const double step = lattice.StepDegrees();
  const auto column = [&](PlanPoint p) { return (plane.longitude + p.x / plane.east_m + 180) / step; };
  const auto row = [&](PlanPoint p) { return (plane.latitude + p.y / plane.north_m + 90) / step; };
  double x0 = column(a), y0 = row(a), x1 = column(b), y1 = row(b);
  // The window with one more node on each side: the nearest nodes of a clipped line stay within it.
  const auto south = static_cast<double>(window.row - 1), north = static_cast<double>(window.row + window.rows);
  if (std::max(y0, y1) < south || std::min(y0, y1) > north) return;
  const auto west = static_cast<double>(window.column - 1), east = static_cast<double>(window.column + window.columns);
  const auto around = static_cast<double>(lattice.columns());
  const auto first_turn = static_cast<std::int64_t>(std::ceil((std::min(x0, x1) - east) / around));
  const auto last_turn = static_cast<std::int64_t>(std::floor((std::max(x0, x1) - west) / around));
  if (first_turn > last_turn) return;
  const auto nearest = [](double value) { return static_cast<std::int64_t>(std::floor(value + 0.5)); };
  const bool is_steep = std::abs(y1 - y0) > std::abs(x1 - x0);
  if (is_steep) std::swap(x0, y0), std::swap(x1, y1);
  if (x0 > x1) std::swap(x0, x1), std::swap(y0, y1);
  const auto visit_between = [&](std::int64_t first, std::int64_t last) {
    for (std::int64_t k = std::max(nearest(x0), first); k <= std::min(nearest(x1), last); ++k) {
      const double t = x1 > x0 ? std::clamp((static_cast<double>(k) - x0) / (x1 - x0), 0.0, 1.0) : 0;
      const std::int64_t across = nearest(y0 + t * (y1 - y0));
      is_steep ? visit(across, k) : visit(k, across);
    }
  };
  if (is_steep) return visit_between(window.row - 1, window.row + window.rows);
  for (std::int64_t turn = first_turn; turn <= last_turn; ++turn) {
    const std::int64_t column_from = window.column + turn * lattice.columns();
    visit_between(column_from - 1, column_from + window.columns);
  }
}

MeshDemands EditSet::DemandsOf(const geo::Lattice& lattice, const NodeWindow& window,
                               std::span<const std::size_t> which) const {
  MeshDemands demands;
  const std::size_t nodes = Area(window.columns, window.rows);
  const auto stride = static_cast<std::size_t>(window.columns);
  std::optional<WindowAxes> axes;
  // Beyond the largest error that a tile of this level is served at, a limit has no effect.
  constexpr double kLargest_m = 77'067 * 32.0;
  const double coarsest = std::ldexp(kLargest_m, -lattice.level);
  for (const std::size_t index : which) {
    const Edit& edit = edits_[index];
    if (edit.changes_heights() || lattice.level < edit.min_level) continue;
    if (!axes) axes.emplace(lattice, window);
    if (edit.op != EditOp::kPrecision) {
      if (demands.forced.empty()) demands.forced.assign(nodes, 0);
      for (const auto& ring : edit.rings) {
        for (std::size_t e = 0; e + (edit.is_area ? 0 : 1) < ring.size(); ++e) {
          ForNodesAlong(lattice, window, edit.plane, ring[e], ring[(e + 1) % ring.size()],
                        [&](std::int64_t c, std::int64_t r) {
                          const std::int64_t i = FloorMod(c - window.column, lattice.columns()), j = r - window.row;
                          if (i < window.columns && j >= 0 && j < window.rows)
                            demands.forced[static_cast<std::size_t>(j) * stride + static_cast<std::size_t>(i)] = 1;
                        });
        }
      }
      if (edit.op == EditOp::kBreakline) continue;
      if (demands.no_triangles.empty()) demands.no_triangles.assign(nodes, 0);
    }
    for (const auto& part : axes->PartsOf(edit.reach)) {
      for (int j = part.first_row; j <= part.last_row; ++j) {
        const EditRow row(edit, edit.plane.Y(axes->latitude(j)));
        for (int i = part.first_column; i <= part.last_column; ++i) {
          const double weight = edit.WeightAt(row.At(edit.plane.X(axes->longitude(i))).distance_m);
          if (weight <= 0) continue;
          const std::size_t at = static_cast<std::size_t>(j) * stride + static_cast<std::size_t>(i);
          if (edit.op == EditOp::kHole) {
            demands.no_triangles[at] = 1;
            continue;
          }
          if (demands.weights.empty()) {
            demands.weights.assign(nodes, 1);
            demands.caps.assign(nodes, std::numeric_limits<float>::infinity());
          }
          // Between the edge and the end of the blend both change geometrically.
          const double error_weight = std::exp2(weight * std::log2(1 / edit.factor));
          demands.weights[at] = std::max(demands.weights[at], static_cast<float>(error_weight));
          if (edit.error_m < coarsest) {
            const double cap = edit.error_m * std::exp2((1 - weight) * std::log2(coarsest / edit.error_m));
            demands.caps[at] = std::min(demands.caps[at], static_cast<float>(cap));
          }
        }
      }
    }
  }
  if (std::ranges::all_of(demands.forced, [](std::uint8_t is_forced) { return is_forced == 0; }))
    demands.forced.clear();
  if (std::ranges::all_of(demands.no_triangles, [](std::uint8_t is_hole) { return is_hole == 0; }))
    demands.no_triangles.clear();
  return demands;
}

}  // namespace terrace::dem

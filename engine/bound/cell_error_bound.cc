#include "engine/bound/cell_error_bound.h"

#include <algorithm>
#include <cmath>

namespace terrace::dem {
namespace {

// Lines between nodes deviate from straight lines by much less than this fraction of the cell: a margin that exceeds
// the curvature of its edges.
constexpr double kBulge = 1.0 / 32;

// The samples whose centres lie in a box of pixels, moved by `shift` columns.
SampleBox CentresIn(const PixelBounds& box, double shift) {
  const auto first = [](double pixel) { return static_cast<std::int64_t>(std::ceil(pixel - 0.5)); };
  const auto last = [](double pixel) { return static_cast<std::int64_t>(std::floor(pixel - 0.5)); };
  return {first(box.west + shift), first(box.north), last(box.east + shift), last(box.south)};
}

// The bilinear surface through the heights at a cell's nodes, in the order south-west, south-east, north-west,
// north-east, at positions in pixels of a raster.
class CellSurface {
 public:
  // `corners`: positions of the nodes in pixels, with an uncertainty of `slack` against positions of samples.
  // `is_separable`: columns are meridians and rows are parallels, evenly spaced.
  CellSurface(const std::array<Position, 4>& corners, bool is_separable, const Position& slack)
      : origin_(corners[0]),
        east_{corners[1].x - origin_.x, corners[1].y - origin_.y},
        north_{corners[2].x - origin_.x, corners[2].y - origin_.y},
        twist_{corners[3].x - corners[1].x - north_.x, corners[3].y - corners[1].y - north_.y} {
    const double bulge = is_separable ? 0 : kBulge;
    const auto extent = [](double east, double north, double twist) {
      return std::abs(east) + std::abs(north) + std::abs(twist);
    };
    slack_x_ = bulge * extent(east_.x, north_.x, twist_.x) + slack.x;
    slack_y_ = bulge * extent(east_.y, north_.y, twist_.y) + slack.y;
  }

  // `heights`: of the corners. `widened`: uncertainty of the samples' heights. In metres.
  void SetHeights(const std::array<double, 4>& heights, double widened) {
    heights_ = heights;
    widened_ = widened;
    const auto [lowest, highest] = std::ranges::minmax(heights);
    lowest_ = lowest - widened, highest_ = highest + widened;
    along_ = std::max(std::abs(heights[1] - heights[0]), std::abs(heights[3] - heights[2]));
    across_ = std::max(std::abs(heights[2] - heights[0]), std::abs(heights[3] - heights[1]));
  }

  // An upper bound of the distance between a sample and the surface, wherever the sample lies.
  double DistanceBound(double sample) const { return std::max(highest_ - sample, sample - lowest_); }

  // The same for a sample at a known position; 0 if that is outside the cell.
  double DistanceBound(const Position& at, double sample) const {
    double u = 0.5, v = 0.5, u_slack = 0, v_slack = 0;
    constexpr int kMaxSteps = 4;
    constexpr double kConverged = 1e-7;  // pixels
    for (int step = 1;; ++step) {
      const double right_x = at.x - origin_.x - u * east_.x - v * north_.x - u * v * twist_.x;
      const double right_y = at.y - origin_.y - u * east_.y - v * north_.y - u * v * twist_.y;
      const double ux = east_.x + v * twist_.x, uy = east_.y + v * twist_.y;
      const double vx = north_.x + u * twist_.x, vy = north_.y + u * twist_.y;
      const double determinant = ux * vy - uy * vx;
      u += (right_x * vy - right_y * vx) / determinant;
      v += (ux * right_y - uy * right_x) / determinant;
      const double off_x = std::abs(right_x), off_y = std::abs(right_y);
      if (step < kMaxSteps && !(off_x < kConverged && off_y < kConverged)) continue;
      // The remaining error is much smaller than the last step.
      const double x = slack_x_ + off_x, y = slack_y_ + off_y;
      u_slack = (std::abs(vy) * x + std::abs(vx) * y) / std::abs(determinant);
      v_slack = (std::abs(uy) * x + std::abs(ux) * y) / std::abs(determinant);
      break;
    }
    const double anywhere = DistanceBound(sample);
    if (!(u_slack < 1 && v_slack < 1)) return anywhere;  // also where it did not converge
    if (u < -u_slack || u > 1 + u_slack || v < -v_slack || v > 1 + v_slack) return 0;
    const double south = heights_[0] + u * (heights_[1] - heights_[0]);
    const double north = heights_[2] + u * (heights_[3] - heights_[2]);
    // Within the slack outside the cell, slopes differ from the cell's only by the twist: twice the slope is enough.
    const double here = std::abs(south + v * (north - south) - sample) + 2 * (u_slack * along_ + v_slack * across_);
    return std::min(anywhere, here + widened_);
  }

 private:
  Position origin_, east_, north_, twist_;
  double slack_x_ = 0, slack_y_ = 0;
  std::array<double, 4> heights_{};
  double widened_ = 0, lowest_ = 0, highest_ = 0;
  double along_ = 0, across_ = 0;  // the largest differences of heights along an edge
};

}  // namespace

SampleBox CellErrorBound::Clipped(SampleBox box) const {
  if (!grid_.wraps()) {
    box.west = std::max<std::int64_t>(box.west, 0);
    box.east = std::min<std::int64_t>(box.east, grid_.columns() - 1);
  }
  box.north = std::max<std::int64_t>(box.north, 0);
  box.south = std::min<std::int64_t>(box.south, grid_.rows() - 1);
  return box;
}

// The largest distance between the heights served at a cell's nodes and heights of the raster grid within these bounds,
// in its vertical datum.
double CellErrorBound::DistanceBound(const TileCell& cell, double lowest, double highest) const {
  double error = 0, geoid_error = geoid_.BoundOver(cell.box());
  std::array<double, 4> geoid{};
  if (!std::isfinite(geoid_error)) {  // not known at some node
    const HeightRange range = geoid_.RangeOf(cell.box());
    lowest += range.min, highest += range.max;
    geoid_error = 0;
  } else if (geoid_.is_added()) {
    for (std::size_t k = 0; k < 4; ++k) geoid[k] = geoid_.AddedAt(cell.nodes[k]);
  }
  for (std::size_t k = 0; k < 4; ++k) {
    const double height = double{tile_.heights[cell.nodes[k]]} - geoid[k];
    error = std::max({error, highest - height, height - lowest});
  }
  return error + geoid_error;
}

double CellErrorBound::BoundByAverages(const TileCell& cell, bool& has_voids) const {
  // If members are misplaced, samples of the cell may count as neighbouring ones. The last average of an axis may be up
  // to twice as near.
  const Position& off = statistics_.misplacement();
  const double off_x = 2 * off.x / reading_.factor, off_y = 2 * off.y / reading_.factor;
  const auto below = [](double weight) { return static_cast<std::int64_t>(std::floor(weight)); };
  const auto above = [](double weight) {
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(weight)));
  };
  SampleBox around;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto [node_column, node_row] = tile_.GlobalNode(cell, k);
    const GridCell at = reading_.cells.OfNode(node_column, node_row);
    SampleBox near{at.column, at.row, at.column + 1, at.row + 1};
    if (off_x > 0 || off_y > 0) {
      near = {at.column + below(at.x - off_x), at.row + below(at.y - off_y), at.column + above(at.x + off_x),
              at.row + above(at.y + off_y)};
    }
    around = around.Around(near);
  }
  if (!grid_.wraps()) {
    around.west = std::max<std::int64_t>(around.west, 0);
    around.east = std::min(around.east, columns_ - 1);
  }
  around.north = std::max<std::int64_t>(around.north, 0);
  around.south = std::min(around.south, rows_ - 1);
  const GridWindow& window = reading_.window;
  const SampleBox read = {std::max(around.west, window.column), std::max(around.north, window.row),
                          std::min(around.east, window.column + window.columns - 1),
                          std::min(around.south, window.row + window.rows - 1)};
  const double error = BoundByBox(cell, read, has_voids);
  return read == around ? error : kUnknownError;
}

// A bound from the averages in a box of the window.
double CellErrorBound::BoundByBox(const TileCell& cell, const SampleBox& averages, bool& has_voids) const {
  const GridWindow& window = reading_.window;
  double lowest = kUnknownError, highest = -lowest;
  for (std::int64_t row = averages.north; row <= averages.south; ++row) {
    const float* const line = reading_.samples.data() + (row - window.row) * window.columns - window.column;
    for (std::int64_t column = averages.west; column <= averages.east; ++column) {
      const float average = line[column];
      has_voids |= std::isnan(average);
      if (std::isnan(average)) continue;
      lowest = std::min(lowest, double{average});
      highest = std::max(highest, double{average});
    }
  }
  const float averaging =
      statistics_.AveragingError(static_cast<double>(averages.west), static_cast<double>(averages.north),
                                 static_cast<double>(averages.east), static_cast<double>(averages.south));
  if (lowest > highest) return averaging > 0 ? kUnknownError : 0;
  return DistanceBound(cell, lowest, highest) + averaging;
}

// A bound from the averages near the samples in a box of pixels; infinite if some were not read.
double CellErrorBound::BoundByAveragesNear(const TileCell& cell, const PixelBounds& box) const {
  const auto index = [&](double pixel) { return static_cast<std::int64_t>(std::floor(pixel / reading_.factor - 0.5)); };
  std::int64_t left = index(box.west), right = index(box.east) + 1;
  // One average more, because the last average of an axis may cover fewer pixels and lie nearer.
  const std::int64_t top = std::clamp<std::int64_t>(index(box.north), 0, rows_ - 1);
  const std::int64_t bottom = std::clamp<std::int64_t>(index(box.south) + 2, 0, rows_ - 1);
  if (!grid_.wraps()) {
    left = std::clamp<std::int64_t>(left, 0, columns_ - 1);
    right = std::clamp<std::int64_t>(right + 1, 0, columns_ - 1);
  } else if (grid_.columns() % reading_.factor != 0) {
    return kUnknownError;
  }
  const GridWindow& window = reading_.window;
  if (top < window.row || bottom >= window.row + window.rows) return kUnknownError;
  for (const int turn : {0, -1, 1}) {
    const std::int64_t shift = turn * columns_;
    if (turn != 0 && !grid_.wraps()) continue;
    if (left + shift < window.column || right + shift >= window.column + window.columns) continue;
    bool has_voids = false;
    return BoundByBox(cell, {left + shift, top, right + shift, bottom}, has_voids);
  }
  return kUnknownError;
}

// Positions of the nodes in pixels; nothing if one of them is unknown.
std::optional<std::array<Position, 4>> CellErrorBound::CornersOf(const TileCell& cell) const {
  std::array<Position, 4> corners;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto [column, row] = tile_.GlobalNode(cell, k);
    corners[k] = reading_.cells.positions().OfNode(column, row);
    if (grid_.georeference().is_geographic_grid()) {
      // The nodes of a pole may share one position: use the columns of the row beside it.
      if (row == 0) corners[k].x = reading_.cells.positions().OfNode(column, row + 1).x;
      if (row == tile_.lattice.rows()) corners[k].x = reading_.cells.positions().OfNode(column, row - 1).x;
      const double turn = grid_.georeference().period(), near = k == 0 ? grid_.columns() / 2.0 : corners[0].x;
      const double turns = (near - corners[k].x) / turn;
      if (std::abs(turns) >= 0.5) corners[k].x += turn * std::round(turns);  // else 0; round is a call
    }
    if (!std::isfinite(corners[k].x) || !std::isfinite(corners[k].y)) return std::nullopt;
  }
  return corners;
}

// For raster grids that span nearly the whole Earth: a box may meet the last columns, the first columns one turn
// further on, or both.
bool CellErrorBound::IsOnBothEnds(const PixelBounds& box) const {
  const double turn = grid_.georeference().period(), columns = grid_.columns();
  if (grid_.wraps() || !(turn > 0)) return false;
  const auto meets = [&](double shift) { return box.east + shift >= 0 && box.west + shift <= columns; };
  return meets(turn) || meets(-turn);
}

// One query for the box in place of one for each cell: the samples around a cell are among those around the box.
bool CellErrorBound::HasNoSamples(const CellBox& box) const {
  const bool has_turns = grid_.georeference().is_geographic_grid();
  const bool is_separable = reading_.cells.positions().is_separable();  // then one row and one column tell all
  const double turn = grid_.georeference().period(), middle = grid_.columns() / 2.0;
  PixelBounds at;
  for (int j = box.south; j <= box.north; ++j) {
    for (int i = box.west; i <= (is_separable && j > box.south ? box.west : box.east); ++i) {
      const std::int64_t column = tile_.window.column + 1 + i, row = tile_.window.row + 1 + j;
      // The places of a pole's nodes are those of the rows beside it, and far from the middle turns may be added.
      if (has_turns && (row <= 0 || row >= tile_.lattice.rows())) return false;
      Position corner = reading_.cells.positions().OfNode(column, row);
      if (!std::isfinite(corner.x) || !std::isfinite(corner.y)) return false;
      // Nodes west of the raster may have places east of it, nearly a turn further on.
      const double turns = has_turns && turn > 0 ? (middle - corner.x) / turn : 0;
      if (std::abs(turns) >= 0.5) corner.x += turn * std::round(turns);
      if (has_turns && turn > 0 && std::abs(corner.x - middle) >= turn / 4) return false;
      at.Add(corner.x, corner.y);
    }
  }
  const Position& off = statistics_.misplacement();
  at.Grow((at.east - at.west) * kBulge + off.x, (at.south - at.north) * kBulge + off.y);
  if (grid_.wraps() || IsOnBothEnds(at)) return false;
  const SampleBox in = CentresIn(at, 0);
  if (in.empty()) return true;
  const BlockRange range = statistics_.Ranges(static_cast<double>(in.west), static_cast<double>(in.north),
                                              static_cast<double>(in.east), static_cast<double>(in.south));
  if (range.min > range.max) return true;
  // The blocks of the statistics are large: samples that were read tell more.
  const GridWindow& window = reading_.window;
  const SampleBox near = Clipped(in);
  if (near.empty()) return true;
  if (reading_.factor > 1 || near.west < window.column || near.east >= window.column + window.columns ||
      near.north < window.row || near.south >= window.row + window.rows) {
    return false;
  }
  for (std::int64_t row = near.north; row <= near.south; ++row) {
    const auto first = reading_.samples.begin() + (row - window.row) * window.columns + (near.west - window.column);
    if (!std::all_of(first, first + near.columns(), [](float sample) { return std::isnan(sample); })) return false;
  }
  return true;
}

double CellErrorBound::BoundBySurroundings(const TileCell& cell, bool between, bool fills, double known,
                                           std::optional<CellSamples>& cell_samples) const {
  const HeightRange& all = grid_.heights();
  const auto corners = CornersOf(cell);
  if (!corners) return DistanceBound(cell, all.min, all.max);
  PixelBounds box;
  for (const Position& corner : *corners) box.Add(corner.x, corner.y);
  // Samples are at the pixels' centres.
  const double halo = between ? 1 : 0;
  const Position& off = statistics_.misplacement();
  box.Grow((box.east - box.west) * kBulge + halo + off.x, (box.south - box.north) * kBulge + halo + off.y);
  if (fills) {
    const double reach = grid_.options().max_void_gap + reading_.factor;
    PixelBounds wide = box;
    wide.Grow(reach, reach);
    fills = grid_.Ranges({wide.west, wide.north, wide.east, wide.south}).has_voids;
    if (fills) box = wide;
  }
  if (IsOnBothEnds(box)) return DistanceBound(cell, all.min, all.max);

  BlockRange range;
  for (const int turn : {0, -1, 1}) {
    if (turn != 0 && !grid_.wraps()) continue;
    const SampleBox in = CentresIn(box, turn * static_cast<double>(grid_.columns()));
    if (in.empty()) return 0;  // like those of other turns
    range.Add(statistics_.Ranges(static_cast<double>(in.west), static_cast<double>(in.north),
                                 static_cast<double>(in.east), static_cast<double>(in.south)));
  }
  if (range.min > range.max) return 0;
  double error = DistanceBound(cell, range.min, range.max);
  if (fills) return error;
  error = std::min(error, BoundByAveragesNear(cell, box));
  cell_samples = CellSamples{*corners, Clipped(CentresIn(box, 0)), between};
  if (reading_.factor > 1) return error;
  for (const int turn : {0, -1, 1}) {
    if (turn != 0 && !grid_.wraps()) continue;
    error = std::min(error, BoundBySamples(cell, *cell_samples, reading_.window, reading_.samples,
                                           turn * static_cast<std::int64_t>(grid_.columns()), known));
  }
  return error;
}

double CellErrorBound::BoundBySamples(const TileCell& cell, const CellSamples& cell_samples, const GridWindow& window,
                                      const std::vector<float>& samples, std::int64_t column_offset,
                                      double known) const {
  const SampleBox& in = cell_samples.samples;
  if (in.empty()) return 0;
  if (in.west + column_offset < window.column || in.east + column_offset >= window.column + window.columns ||
      in.north < window.row || in.south >= window.row + window.rows) {
    return kUnknownError;
  }
  const Position& off = statistics_.misplacement();
  const double slack = MaxPositionError(grid_.georeference()) * reading_.factor;
  const bool is_separable = grid_.georeference().is_geographic_grid() && grid_.georeference().is_affine();
  CellSurface surface(cell_samples.corners, is_separable, {off.x + slack, off.y + slack});
  const double geoid_error = geoid_.BoundOver(cell.box());
  const bool is_known = std::isfinite(geoid_error);
  const HeightRange range = is_known ? HeightRange{0, 0} : geoid_.RangeOf(cell.box());
  std::array<double, 4> heights{};  // served at the nodes, in the raster grid's vertical datum
  for (std::size_t k = 0; k < 4; ++k) {
    const bool is_added = is_known && geoid_.is_added();
    const double geoid = is_added ? geoid_.AddedAt(cell.nodes[k]) : (range.min + range.max) / 2;
    heights[k] = double{tile_.heights[cell.nodes[k]]} - geoid;
  }
  surface.SetHeights(heights, is_known ? geoid_error : (range.max - range.min) / 2);
  double error = 0, lowest = kUnknownError, highest = -lowest;
  for (std::int64_t row = in.north; row <= in.south; ++row) {
    const float* const line = samples.data() + (row - window.row) * window.columns + (column_offset - window.column);
    for (std::int64_t column = in.west; column <= in.east; ++column) {
      const double sample = line[column];
      if (std::isnan(sample)) continue;
      lowest = std::min(lowest, sample), highest = std::max(highest, sample);
      if (cell_samples.between || surface.DistanceBound(sample) <= std::max(error, known)) continue;
      error = std::max(
          error, surface.DistanceBound({static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5}, sample));
    }
  }
  if (cell_samples.between && lowest <= highest) error = DistanceBound(cell, lowest, highest);
  return error;
}

}  // namespace terrace::dem

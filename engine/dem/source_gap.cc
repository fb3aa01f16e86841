#include "engine/dem/source_gap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace terrace::dem {

namespace {

// Cells per axis that are judged together where nothing is in the way.
constexpr int kGroup = 16;

// Half-open, in cells of the tile.
struct CellBox {
  int west = 0, south = 0, east = 0, north = 0;
};

// A cell of the tile by its column and row, with its nodes: the south-western, south-eastern, north-western,
// north-eastern one.
struct TileCell {
  int i, j;
  std::array<std::size_t, 4> nodes;

  CellBox box() const { return {i, j, i + 1, j + 1}; }
};

// Columns and rows of pixels, between which a function's values lie.
struct PixelBounds {
  double west = std::numeric_limits<double>::infinity(), east = -west, north = west, south = -west;

  void Add(double x, double y) {
    west = std::min(west, x), east = std::max(east, x);
    north = std::min(north, y), south = std::max(south, y);
  }
  void Grow(double x, double y) { west -= x, east += x, north -= y, south += y; }
};

// How much a surface between samples can bend, from the samples of a box: largest differences.
struct Bends {
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0;
};

// What the node positions of a box of cells say: how far it is from one node to the next, in samples, and how far
// that is from an even step.
struct Steps {
  double east_x = 0, east_y = 0, north_x = 0, north_y = 0, bend_x = 0, bend_y = 0;
};

// A function that is linear between samples one apart, with second differences of at most 1, strays from its chord over
// `length` samples by at most this: at most one kink on less than a sample; (length^2 + 1) / 8 with more.
double ChordGap(double length) { return length < 1 ? length / 4 : (length * length + 1) / 8; }

double LargestGap(const Bends& bends, const Steps& steps) {
  const auto along = [&](double x, double y) {
    return ChordGap(x) * bends.xx + ChordGap(y) * bends.yy + x * y * bends.xy / 4;
  };
  return along(steps.east_x, steps.east_y) + along(steps.north_x, steps.north_y) + steps.bend_x * bends.x +
         steps.bend_y * bends.y;
}

// The surface that is bilinear between the heights at a cell's nodes, by places in the raster.
class CellSurface {
 public:
  // `corners`: the nodes' places in pixels, known to that slack. `is_separable`: columns are meridians and rows are
  // parallels, evenly spaced.
  CellSurface(const std::array<Position, 4>& corners, bool is_separable, double position_slack)
      : origin_(corners[0]),
        east_{corners[1].x - origin_.x, corners[1].y - origin_.y},
        north_{corners[2].x - origin_.x, corners[2].y - origin_.y},
        twist_{corners[3].x - corners[1].x - north_.x, corners[3].y - corners[1].y - north_.y} {
    // Lines between nodes stray from straight ones by far less than that part of the cell.
    constexpr double kBulge = 1.0 / 32;
    const double bulge = is_separable ? 0 : kBulge;
    const auto extent = [](double east, double north, double twist) {
      return std::abs(east) + std::abs(north) + std::abs(twist);
    };
    slack_x_ = bulge * extent(east_.x, north_.x, twist_.x) + position_slack;
    slack_y_ = bulge * extent(east_.y, north_.y, twist_.y) + position_slack;
  }

  void SetHeight(std::size_t corner, double height) { heights_[corner] = height; }
  void Widen(double gap) { widened_ += gap; }

  // How far a sample at a place is from the surface, at most; 0 where the place is outside the cell.
  double Apart(const Position& at, double sample) const {
    double u = 0.5, v = 0.5, u_slack = kInfinity, v_slack = kInfinity;
    constexpr int kSteps = 4;
    for (int step = 0; step < kSteps; ++step) {
      const double right_x = at.x - origin_.x - u * east_.x - v * north_.x - u * v * twist_.x;
      const double right_y = at.y - origin_.y - u * east_.y - v * north_.y - u * v * twist_.y;
      const double ux = east_.x + v * twist_.x, uy = east_.y + v * twist_.y;
      const double vx = north_.x + u * twist_.x, vy = north_.y + u * twist_.y;
      const double scale = 1 / std::abs(ux * vy - uy * vx);
      const double sign = ux * vy - uy * vx < 0 ? -scale : scale;
      u += (right_x * vy - right_y * vx) * sign;
      v += (ux * right_y - uy * right_x) * sign;
      // What is left after this step is far below what the last one moved.
      const double x = slack_x_ + (step + 1 < kSteps ? 0 : std::abs(right_x));
      const double y = slack_y_ + (step + 1 < kSteps ? 0 : std::abs(right_y));
      u_slack = (std::abs(vy) * x + std::abs(vx) * y) * scale;
      v_slack = (std::abs(uy) * x + std::abs(ux) * y) * scale;
    }
    const auto [lowest, highest] = std::minmax_element(heights_.begin(), heights_.end());
    const double anywhere = std::max(*highest - sample, sample - *lowest) + widened_;
    if (!(u_slack < 1 && v_slack < 1)) return anywhere;  // also where it did not converge
    if (u < -u_slack || u > 1 + u_slack || v < -v_slack || v > 1 + v_slack) return 0;
    const double south = heights_[0] + u * (heights_[1] - heights_[0]);
    const double north = heights_[2] + u * (heights_[3] - heights_[2]);
    const double along = std::max(std::abs(heights_[1] - heights_[0]), std::abs(heights_[3] - heights_[2]));
    const double across = std::max(std::abs(heights_[2] - heights_[0]), std::abs(heights_[3] - heights_[1]));
    // Outside the cell by no more than the slack the slopes are the cell's, but for the twist: twice is enough.
    const double here = std::abs(south + v * (north - south) - sample) + 2 * (u_slack * along + v_slack * across);
    return std::min(anywhere, here + widened_);
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Position origin_, east_, north_, twist_;
  double slack_x_ = 0, slack_y_ = 0;
  std::array<double, 4> heights_{};
  double widened_ = 0;
};

}  // namespace

// One sheet's part.
class SheetGap {
 public:
  SheetGap(SourceGap& tile, const Sheet& sheet, const SheetTrace& trace)
      : tile_(tile),
        sheet_(sheet),
        trace_(trace),
        cells_(tile.lattice_.cells),
        stride_(static_cast<std::size_t>(tile.window_.columns)) {
    PlaceNodes();
    FindMembers();
    heights_ = sheet.members().front().raster->info().heights;
    for (const SheetMember& member : sheet.members()) {
      heights_.min = std::min(heights_.min, member.raster->info().heights.min);
      heights_.max = std::max(heights_.max, member.raster->info().heights.max);
    }
  }

  Result<void> Add(const std::stop_token& stop) {
    for (int south = 0; south < cells_; south += kGroup) {
      for (int west = 0; west < cells_; west += kGroup) {
        AddGroup({west, south, std::min(west + kGroup, cells_), std::min(south + kGroup, cells_)});
      }
    }
    return ReadLoose(stop);
  }

 private:
  // Of the south-western node of a cell.
  std::size_t NodeOf(int i, int j) const {
    return static_cast<std::size_t>(j + 1) * stride_ + static_cast<std::size_t>(i + 1);
  }
  std::size_t CellIndex(int i, int j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(cells_) + static_cast<std::size_t>(i);
  }

  // Nodes that took their height from this sheet, away from its rim: where the surface ends, and where the last average
  // of an axis stands for fewer samples, it is no even grid.
  void PlaceNodes() {
    constexpr double kNowhereNear = std::numeric_limits<double>::quiet_NaN();
    x_.assign(trace_.positions.size(), kNowhereNear);
    y_ = x_;
    const GridAxis columns(sheet_.columns(), trace_.factor, sheet_.wraps()), rows(sheet_.rows(), trace_.factor, false);
    const auto last = [&](const GridAxis& axis, int samples) {
      return static_cast<double>(axis.count() - (samples % trace_.factor == 0 ? 1 : 2));
    };
    const double last_x = last(columns, sheet_.columns()), last_y = last(rows, sheet_.rows());
    for (std::size_t n = 0; n < x_.size(); ++n) {
      const std::int32_t at = trace_.cell_of_node[n];
      if (at < 0) continue;
      const GridCell& cell = trace_.cells[static_cast<std::size_t>(at)];
      const double x = static_cast<double>(cell.column) + cell.x, y = static_cast<double>(cell.row) + cell.y;
      const bool even_x =
          sheet_.wraps() ? sheet_.columns() % trace_.factor == 0 || (x >= 0 && x <= last_x) : x > 0 && x < last_x;
      if (!even_x || !(y > 0 && y < last_y)) continue;
      x_[n] = x;
      y_[n] = y;
    }
  }

  // Rasters of the sheet around the tile.
  void FindMembers() {
    if (sheet_.members().size() == 1) {
      near_ = {0};
      return;
    }
    Box hull{1e300, 1e300, -1e300, -1e300};
    bool known = !sheet_.wraps();
    for (const Position& p : trace_.positions) {
      known &= std::isfinite(p.x) && std::isfinite(p.y);
      hull = {std::min(hull.west, p.x), std::min(hull.south, p.y), std::max(hull.east, p.x), std::max(hull.north, p.y)};
    }
    const double halo = 4.0 * trace_.factor;
    if (!known) hull = {-1e300, -1e300, 1e300, 1e300};
    near_ = sheet_.MembersAt({hull.west - halo, hull.south - halo, hull.east + halo, hull.north + halo});
  }

  // At least the range of pixels in a box, clipped to the sheet.
  BlockRange Ranges(double west, double north, double east, double south) const {
    BlockRange range;
    for (const std::size_t i : near_) {
      const SheetMember& member = sheet_.members()[i];
      const auto x = static_cast<double>(member.column), y = static_cast<double>(member.row);
      range.Add(member.raster->ranges().Query(west - x, north - y, east - x, south - y));
    }
    return range;
  }

  // How far samples in a box of pixels are from the surface between averages (averaging_errors.h), where that surface
  // is one raster's own; infinite elsewhere.
  float ErrorOfAverages(double west, double north, double east, double south) const {
    const int factor = trace_.factor;
    if (factor == 1) return 0;  // averages of one sample
    if (sheet_.members().size() == 1) {
      return sheet_.members().front().raster->averaging_errors().Largest(factor, west, north, east, south);
    }
    constexpr float kNotTold = std::numeric_limits<float>::infinity();
    if (sheet_.alignment() < factor) return kNotTold;
    const SheetMember* only = nullptr;
    for (const std::size_t i : near_) {
      const geo::TileRange pixels = sheet_.members()[i].pixels();
      if (east < static_cast<double>(pixels.start_x) || west > static_cast<double>(pixels.end_x + 1) ||
          south < static_cast<double>(pixels.start_y) || north > static_cast<double>(pixels.end_y + 1)) {
        continue;
      }
      if (only != nullptr) return kNotTold;
      only = &sheet_.members()[i];
    }
    if (only == nullptr) return 0;
    const RasterLayout& layout = only->raster->layout();
    const auto whole = [factor](int samples) { return static_cast<double>(samples / factor * factor); };
    const auto x = static_cast<double>(only->column), y = static_cast<double>(only->row);
    if (west < x || north < y || east > x + whole(layout.columns) || south > y + whole(layout.height)) return kNotTold;
    return only->raster->averaging_errors().Largest(factor, west - x, north - y, east - x, south - y);
  }

  double West(const CellBox& box) const { return tile_.lattice_.Longitude(tile_.window_.column + 1 + box.west); }
  double South(const CellBox& box) const { return tile_.lattice_.Latitude(tile_.window_.row + 1 + box.south); }
  double Width(const CellBox& box) const { return tile_.lattice_.StepDegrees() * (box.east - box.west); }
  double Height(const CellBox& box) const { return tile_.lattice_.StepDegrees() * (box.north - box.south); }

  bool Touches(const CellBox& box) const {
    return sheet_.reach().Touches(West(box), South(box), Width(box), Height(box));
  }

  // Of the nodes of a box, in averages; infinite where one of them is away from the even part.
  PixelBounds BoundsOf(const CellBox& box) const {
    PixelBounds bounds;
    for (int j = box.south; j <= box.north; ++j) {
      for (int i = box.west; i <= box.east; ++i) {
        const std::size_t n = NodeOf(i, j);
        if (std::isnan(x_[n])) return {};
        bounds.Add(x_[n], y_[n]);
      }
    }
    return bounds;
  }

  // Where sheets are blended every sheet that may count is judged on its own: what they are blended to lies between
  // them. Heights that were filled in count as well.
  bool GivesWay(const CellBox& box) const {
    if (!tile_.blends_) return false;
    const PixelBounds at = BoundsOf(box);
    const double factor = trace_.factor;
    if (!(at.west <= at.east)) return true;
    if (trace_.includes_filled && CountInFull(at)) return false;
    return sheet_.GivesWay({at.west * factor, at.north * factor, (at.east + 1) * factor, (at.south + 1) * factor},
                           trace_.factor);
  }
  // All samples around a box. Weights are rounded to 2^-10.
  bool CountInFull(const PixelBounds& at) const {
    if (trace_.weights.empty()) return true;
    const GridWindow& window = trace_.window;
    const auto west = static_cast<std::int64_t>(std::floor(at.west)) - 1;
    const auto east = static_cast<std::int64_t>(std::floor(at.east)) + 2;
    const auto north = static_cast<std::int64_t>(std::floor(at.north)) - 1;
    const auto south = static_cast<std::int64_t>(std::floor(at.south)) + 2;
    if (west < window.column || east >= window.column + window.columns || north < window.row ||
        south >= window.row + window.rows) {
      return false;
    }
    for (std::int64_t row = north; row <= south; ++row) {
      const auto first = trace_.weights.begin() + (row - window.row) * window.columns + (west - window.column);
      if (std::any_of(first, first + (east - west + 1), [](float weight) { return weight < 1; })) return false;
    }
    return true;
  }

  // Whether something may be filled in there that the trace does not have.
  bool MayBeFilled(const CellBox& box) const {
    if (trace_.includes_filled) return false;
    const PixelBounds at = BoundsOf(box);
    const double factor = trace_.factor;
    return !(at.west <= at.east) || sheet_
                                        .Ranges({(at.west - 1) * factor, (at.north - 1) * factor,
                                                 (at.east + 2) * factor, (at.south + 2) * factor})
                                        .has_voids;
  }

  void AddGroup(const CellBox& box) {
    if (!Touches(box)) return;
    const bool gives_way = GivesWay(box), is_filled = gives_way && MayBeFilled(box);
    if (const double gap = is_filled ? kUnknown : SmoothGap(box); std::isfinite(gap)) {
      Raise(gap);
      if (gives_way) return;
      for (int j = box.south; j < box.north; ++j) {
        std::fill_n(tile_.covered_.begin() + static_cast<std::ptrdiff_t>(CellIndex(box.west, j)), box.east - box.west,
                    1);
      }
      return;
    }
    loose_.emplace_back();
    for (int j = box.south; j < box.north; ++j) {
      for (int i = box.west; i < box.east; ++i) {
        if (tile_.covered_[CellIndex(i, j)] == 0) AddCell(i, j, gives_way && GivesWay({i, j, i + 1, j + 1}));
      }
    }
  }

  void AddCell(int i, int j, bool gives_way) {
    const std::size_t n = NodeOf(i, j);
    const bool fills = gives_way && !trace_.includes_filled;
    const TileCell cell{i, j, {n, n + 1, n + stride_, n + stride_ + 1}};
    if (std::ranges::any_of(cell.nodes, [&](std::size_t node) { return trace_.cell_of_node[node] < 0; })) {
      if (Touches(cell.box())) Raise(RangeGap(cell, gives_way, fills));
      return;
    }
    bool has_voids = false;
    double gap = SampleGap(cell, has_voids);
    if (fills && (has_voids || MayBeFilled(cell.box()))) return Raise(RangeGap(cell, gives_way, true));
    double smooth = kUnknown;
    if (!has_voids) {
      if (!gives_way) tile_.covered_[CellIndex(i, j)] = 1;
      smooth = SmoothGap(cell.box());
      if (smooth < gap) gap = smooth;
    }
    if (!std::isfinite(smooth) && gap > tile_.bound_) gap = RangeGap(cell, gives_way, fills, gap);
    Raise(gap);
  }

  void Raise(double gap) { tile_.bound_ = std::max(tile_.bound_, gap); }

  // The heights served in a cell, as the sheet's samples count.
  CellSurface SurfaceOf(const TileCell& cell, const std::array<Position, 4>& corners) const {
    const bool is_separable = sheet_.georeference().is_geographic_grid() && sheet_.georeference().is_affine();
    constexpr double kPosition = 4e-5;  // of averages: NodePositions is exact to a hundred-thousandth
    CellSurface surface(corners, is_separable, kPosition * trace_.factor);
    const double geoid_gap = GeoidGap(cell.box());
    const HeightRange range = std::isfinite(geoid_gap) ? HeightRange{0, 0} : GeoidRange(cell.box());
    for (std::size_t k = 0; k < 4; ++k) {
      const bool is_known = sheet_.undulations() != nullptr && std::isfinite(geoid_gap);
      const double geoid = is_known ? trace_.undulations[cell.nodes[k]] : (range.min + range.max) / 2;
      surface.SetHeight(k, double{tile_.heights_[cell.nodes[k]]} - geoid);
    }
    surface.Widen(std::isfinite(geoid_gap) ? geoid_gap : (range.max - range.min) / 2);
    return surface;
  }

  // Between the heights served at a cell's nodes and the sheet's heights within these bounds, which count as its
  // samples do.
  double Apart(const TileCell& cell, double lowest, double highest) const {
    double gap = 0, geoid_gap = 0;
    std::array<double, 4> geoid{};
    if (sheet_.undulations() != nullptr) {
      geoid_gap = GeoidGap(cell.box());
      if (std::isfinite(geoid_gap)) {
        for (std::size_t k = 0; k < 4; ++k) geoid[k] = trace_.undulations[cell.nodes[k]];
      } else {  // not known at all of the nodes
        const HeightRange range = GeoidRange(cell.box());
        lowest += range.min, highest += range.max;
        geoid_gap = 0;
      }
    }
    for (std::size_t k = 0; k < 4; ++k) {
      const double height = double{tile_.heights_[cell.nodes[k]]} - geoid[k];
      gap = std::max({gap, highest - height, height - lowest});
    }
    return gap + geoid_gap;
  }

  HeightRange GeoidRange(const CellBox& box) const {
    return sheet_.undulations()->RangeOf(West(box), South(box), Width(box), Height(box));
  }

  // How far the geoid is from the surface that is bilinear between its undulations at nodes; 0 where none are added,
  // infinite where they are not known.
  //
  // A geoid is bilinear on a grid of its own. Where that is coarser than the lattice, a step between nodes crosses one
  // of its lines at most. There the chord is off by at most a quarter of the step times the change of slope, and the
  // larger second difference at the ends of the step is at least half of that product: half a second difference for
  // each axis. The whole is taken, as the change of slope varies along the line.
  double GeoidGap(const CellBox& box) const {
    if (sheet_.undulations() == nullptr) return 0;
    // The finest grids in use have cells of half a minute.
    constexpr double kFinestGeoid = 1.0 / 120;
    if (tile_.lattice_.StepDegrees() > kFinestGeoid / 2) return CoarseGeoidGap(box);
    const auto at = [&](int i, int j) { return trace_.undulations[NodeOf(i, j)]; };
    double xx = 0, yy = 0, xy = 0, sum = 0;
    for (int j = box.south; j <= box.north; ++j) {
      for (int i = box.west; i <= box.east; ++i) {
        const double here = at(i, j), east = at(i + 1, j), north = at(i, j + 1);
        const double along = std::abs(east - here - (here - at(i - 1, j)));
        const double across = std::abs(north - here - (here - at(i, j - 1)));
        sum += along + across;
        xx = std::max(xx, along);
        yy = std::max(yy, across);
        if (i < box.east && j < box.north) xy = std::max(xy, std::abs(at(i + 1, j + 1) - north - (east - here)));
      }
    }
    if (!std::isfinite(sum)) return kUnknown;
    return 2 * Undulations::kTolerance + xx + yy + xy;
  }

  // By bounds on the geoid around each cell.
  double CoarseGeoidGap(const CellBox& box) const {
    double gap = 0;
    for (int j = box.south; j < box.north; ++j) {
      for (int i = box.west; i < box.east; ++i) {
        const std::size_t n = NodeOf(i, j);
        const HeightRange range = GeoidRange({i, j, i + 1, j + 1});
        for (const std::size_t node : {n, n + 1, n + stride_, n + stride_ + 1}) {
          const double geoid = trace_.undulations[node];
          if (std::isnan(geoid)) return kUnknown;
          gap = std::max({gap, range.max - geoid, geoid - range.min});
        }
      }
    }
    return gap + Undulations::kTolerance;
  }

  // Between the heights served and the sheet's own, at the nodes of a box.
  double LargestBlend(const CellBox& box) const {
    if (!tile_.blends_) return 0;
    float largest = 0;
    for (int j = box.south; j <= box.north; ++j) {
      for (int i = box.west; i <= box.east; ++i) {
        const std::size_t n = NodeOf(i, j);
        largest = std::max(largest, std::abs(tile_.heights_[n] - trace_.heights[n]));
      }
    }
    return largest;
  }

  // Of averages by column and row of the grid, ends included.
  float AveragingError(double west, double north, double east, double south) const {
    const double factor = trace_.factor, turn = sheet_.columns();
    west *= factor, north *= factor, east = (east + 1) * factor, south = (south + 1) * factor;
    const auto error = [&](double shift) { return ErrorOfAverages(west + shift, north, east + shift, south); };
    float largest = error(0);
    if (sheet_.wraps() && west < 0) largest = std::max(largest, error(turn));
    if (sheet_.wraps() && east > turn) largest = std::max(largest, error(-turn));
    return largest;
  }

  // The surface is between the samples around the cell, and the samples that those average within their error of it.
  double SampleGap(const TileCell& cell, bool& has_voids) const {
    std::int64_t west = std::numeric_limits<std::int64_t>::max(), east = std::numeric_limits<std::int64_t>::min();
    std::int64_t north = west, south = east;
    for (const std::size_t node : cell.nodes) {
      const GridCell& at = trace_.cells[static_cast<std::size_t>(trace_.cell_of_node[node])];
      west = std::min(west, at.column);
      east = std::max(east, at.column + 1);
      north = std::min(north, at.row);
      south = std::max(south, at.row + 1);
    }
    const GridWindow& window = trace_.window;
    east = std::min(east, window.column + window.columns - 1);
    south = std::min(south, window.row + window.rows - 1);
    return BoxGap(cell, west, north, east, south, has_voids);
  }

  // The same for averages in a box, ends included.
  double BoxGap(const TileCell& cell, std::int64_t west, std::int64_t north, std::int64_t east, std::int64_t south,
                bool& has_voids) const {
    double lowest = kUnknown, highest = -lowest;
    for (std::int64_t row = north; row <= south; ++row) {
      for (std::int64_t column = west; column <= east; ++column) {
        const float sample = SampleAt(column, row);
        has_voids |= std::isnan(sample);
        if (std::isnan(sample)) continue;
        lowest = std::min(lowest, double{sample});
        highest = std::max(highest, double{sample});
      }
    }
    const float averaging = AveragingError(static_cast<double>(west), static_cast<double>(north),
                                           static_cast<double>(east), static_cast<double>(south));
    if (lowest > highest) return averaging > 0 ? kUnknown : 0;
    return Apart(cell, lowest, highest) + averaging;
  }

  float SampleAt(std::int64_t column, std::int64_t row) const {
    const GridWindow& window = trace_.window;
    return trace_.samples[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
  }

  // Where the surface between samples and the one between nodes differ by no more than either bends; NaN or infinity
  // where the box is no such place.
  double SmoothGap(const CellBox& box) const {
    Steps steps;
    PixelBounds at;
    double finite = 0;  // becomes NaN with any position
    const auto raise = [](double& largest, double value) { largest = std::max(largest, std::abs(value)); };
    for (int j = box.south; j <= box.north; ++j) {
      std::size_t n = NodeOf(box.west, j);
      for (int i = box.west; i <= box.east; ++i, ++n) {
        const double x = x_[n], y = y_[n];
        const double east_x = x_[n + 1] - x, east_y = y_[n + 1] - y;
        const double north_x = x_[n + stride_] - x, north_y = y_[n + stride_] - y;
        const double west_x = x - x_[n - 1], west_y = y - y_[n - 1];
        const double south_x = x - x_[n - stride_], south_y = y - y_[n - stride_];
        finite += east_x + north_x + west_x + south_x;
        raise(steps.east_x, i < box.east ? east_x : 0);
        raise(steps.east_y, i < box.east ? east_y : 0);
        raise(steps.north_x, j < box.north ? north_x : 0);
        raise(steps.north_y, j < box.north ? north_y : 0);
        steps.bend_x = std::max({steps.bend_x, std::abs(east_x - west_x), std::abs(north_x - south_x)});
        steps.bend_y = std::max({steps.bend_y, std::abs(east_y - west_y), std::abs(north_y - south_y)});
        at.Add(x, y);
      }
    }
    if (!std::isfinite(finite)) return std::numeric_limits<double>::quiet_NaN();
    // A line that bends by b per step is off its chord by b / 8; half as much again for how the bend itself changes, in
    // both directions. Positions are known to a hundred-thousandth.
    constexpr double kOffChord = 1.5 * 2 / 8, kPosition = 4e-5;
    steps.bend_x = steps.bend_x * kOffChord + kPosition;
    steps.bend_y = steps.bend_y * kOffChord + kPosition;
    Bends bends;
    const auto left = static_cast<std::int64_t>(std::floor(at.west)),
               right = static_cast<std::int64_t>(std::floor(at.east)) + 1;
    const auto top = static_cast<std::int64_t>(std::floor(at.north)),
               bottom = static_cast<std::int64_t>(std::floor(at.south)) + 1;
    if (!MeasureBends(left, top, right, bottom, bends)) return std::numeric_limits<double>::quiet_NaN();
    return LargestGap(bends, steps) + GeoidGap(box) + LargestBlend(box) +
           AveragingError(static_cast<double>(left), static_cast<double>(top), static_cast<double>(right),
                          static_cast<double>(bottom));
  }

  // Of samples left .. right, top .. bottom, which surround the box; false where one of them is void.
  bool MeasureBends(std::int64_t left, std::int64_t top, std::int64_t right, std::int64_t bottom, Bends& bends) const {
    const GridWindow& window = trace_.window;
    right = std::min(right, window.column + window.columns - 1);
    bottom = std::min(bottom, window.row + window.rows - 1);
    const auto columns = static_cast<std::size_t>(right - left + 1);
    const auto stride = static_cast<std::size_t>(window.columns);
    float x = 0, y = 0, xx = 0, yy = 0, xy = 0, sum = 0;
    for (std::int64_t row = top; row <= bottom; ++row) {
      const float* here = trace_.samples.data() + (row - window.row) * window.columns + (left - window.column);
      for (std::size_t c = 0; c < columns; ++c) sum += here[c];
      for (std::size_t c = 0; c + 1 < columns; ++c) x = std::max(x, std::abs(here[c + 1] - here[c]));
      for (std::size_t c = 1; c + 1 < columns; ++c) {
        xx = std::max(xx, std::abs(here[c + 1] - here[c] - (here[c] - here[c - 1])));
      }
      if (row == bottom) break;
      const float* below = here + stride;
      for (std::size_t c = 0; c < columns; ++c) y = std::max(y, std::abs(below[c] - here[c]));
      for (std::size_t c = 0; c + 1 < columns; ++c) {
        xy = std::max(xy, std::abs(here[c + 1] - here[c] - (below[c + 1] - below[c])));
      }
      if (row == top) continue;
      const float* above = here - stride;
      for (std::size_t c = 0; c < columns; ++c) {
        yy = std::max(yy, std::abs(below[c] - here[c] - (here[c] - above[c])));
      }
    }
    constexpr double kUp = 1 + 1e-6;  // of differences of floats
    bends = {x * kUp, y * kUp, xx * kUp, yy * kUp, xy * kUp};
    return std::isfinite(sum);
  }

  // Against the averages that samples in a box of pixels are near to; infinite where not all of them were read.
  double NearGap(const TileCell& cell, double west, double north, double east, double south) const {
    const GridAxis columns(sheet_.columns(), trace_.factor, sheet_.wraps()), rows(sheet_.rows(), trace_.factor, false);
    const auto index = [&](double pixel) { return static_cast<std::int64_t>(std::floor(pixel / trace_.factor - 0.5)); };
    std::int64_t left = index(west), right = index(east) + 1;
    // The last average of an axis may stand for fewer pixels, and lie nearer: one more.
    const std::int64_t top = std::clamp<std::int64_t>(index(north), 0, rows.count() - 1);
    const std::int64_t bottom = std::clamp<std::int64_t>(index(south) + 2, 0, rows.count() - 1);
    if (!sheet_.wraps()) {
      left = std::clamp<std::int64_t>(left, 0, columns.count() - 1);
      right = std::clamp<std::int64_t>(right + 1, 0, columns.count() - 1);
    } else if (sheet_.columns() % trace_.factor != 0) {
      return kUnknown;
    }
    const GridWindow& window = trace_.window;
    if (top < window.row || bottom >= window.row + window.rows) return kUnknown;
    for (const int turn : {0, -1, 1}) {
      const std::int64_t shift = turn * columns.count();
      if (turn != 0 && !sheet_.wraps()) continue;
      if (left + shift < window.column || right + shift >= window.column + window.columns) continue;
      bool has_voids = false;
      return BoxGap(cell, left + shift, top, right + shift, bottom, has_voids);
    }
    return kUnknown;
  }

  // Where the cell's nodes are, in pixels; false where that cannot be told.
  bool Place(const TileCell& cell, std::array<Position, 4>& corners) const {
    for (std::size_t k = 0; k < 4; ++k) {
      corners[k] = trace_.positions[cell.nodes[k]];
      if (sheet_.georeference().is_geographic_grid()) {
        // All of a pole's nodes have one position: their columns are those of the row beside it.
        const std::int64_t row = tile_.window_.row + 1 + cell.j + (k < 2 ? 0 : 1);
        if (row == 0 || row == tile_.lattice_.rows()) {
          corners[k].x = trace_.positions[cell.nodes[k] + (k < 2 ? stride_ : 0) - (k < 2 ? 0 : stride_)].x;
        }
        const double turn = sheet_.georeference().period(), near = k == 0 ? sheet_.columns() / 2.0 : corners[0].x;
        corners[k].x += turn * std::round((near - corners[k].x) / turn);
      }
      if (!std::isfinite(corners[k].x) || !std::isfinite(corners[k].y)) return false;
    }
    return true;
  }

  // Columns and rows of samples in a box of pixels, ends included, a turn on or not.
  struct Centres {
    std::int64_t west, north, east, south;
    bool empty() const { return west > east || north > south; }
  };
  static Centres CentresIn(const PixelBounds& box, double shift) {
    const auto first = [](double pixel) { return static_cast<std::int64_t>(std::ceil(pixel - 0.5)); };
    const auto last = [](double pixel) { return static_cast<std::int64_t>(std::floor(pixel - 0.5)); };
    return {first(box.west + shift), first(box.north), last(box.east + shift), last(box.south)};
  }

  // What the sheet has in a cell that is no part of its even grid: the least of several bounds, `known` among them; 0
  // for one that is among the loose ones now. `gives_way`: the sheet is blended there, and its height between samples
  // counts as they do. `fills`: what is filled in counts too.
  double RangeGap(const TileCell& cell, bool gives_way, bool fills, double known = kUnknown) {
    std::array<Position, 4> corners;
    if (!Place(cell, corners)) return std::min(known, Apart(cell, heights_.min, heights_.max));
    PixelBounds box;
    for (const Position& corner : corners) box.Add(corner.x, corner.y);
    // Edges of cells bulge by far less. The samples are at the pixels' centres.
    constexpr double kBulge = 1.0 / 32;
    double halo = gives_way ? 1 : 0;
    if (fills) halo += sheet_.options().max_void_gap + trace_.factor;
    box.Grow((box.east - box.west) * kBulge + halo, (box.south - box.north) * kBulge + halo);
    std::array<Centres, 3> turns;  // none, back, on
    bool is_empty = true;
    BlockRange range;
    for (const int turn : {0, -1, 1}) {
      Centres& centres = turns[static_cast<std::size_t>((turn + 3) % 3)];
      centres = CentresIn(box, turn * static_cast<double>(sheet_.columns()));
      if ((turn != 0 && !sheet_.wraps()) || centres.empty()) continue;
      is_empty = false;
      range.Add(Ranges(static_cast<double>(centres.west), static_cast<double>(centres.north),
                       static_cast<double>(centres.east), static_cast<double>(centres.south)));
    }
    if (is_empty || range.min > range.max) return 0;
    double gap = std::min(known, Apart(cell, range.min, range.max));
    if (fills) return gap;
    gap = std::min(gap, NearGap(cell, box.west, box.north, box.east, box.south));
    if (gives_way) return gap;
    if (IsWorthReading(gap)) {
      loose_.back().cells.push_back({cell, corners, turns[0], gap});
      loose_.back().gap = std::max(loose_.back().gap, gap);
      return 0;
    }
    if (trace_.factor > 1) return gap;
    for (const int turn : {0, -1, 1}) {
      if (turn != 0 && !sheet_.wraps()) continue;
      gap = std::min(gap, CentreGap(cell, corners, turns[0], trace_.window, trace_.samples,
                                    turn * std::int64_t{sheet_.columns()}));
    }
    return gap;
  }

  // Against the samples in the cell themselves; infinite where not all of them are in the window. `turn`: how many
  // columns on the window's samples are.
  double CentreGap(const TileCell& cell, const std::array<Position, 4>& corners, const Centres& within,
                   const GridWindow& window, const std::vector<float>& samples, std::int64_t turn) const {
    const Centres in = Clipped(within);
    if (in.empty()) return 0;
    if (in.west + turn < window.column || in.east + turn >= window.column + window.columns || in.north < window.row ||
        in.south >= window.row + window.rows) {
      return kUnknown;
    }
    const CellSurface surface = SurfaceOf(cell, corners);
    double gap = 0;
    for (std::int64_t row = in.north; row <= in.south; ++row) {
      const float* const line = samples.data() + (row - window.row) * window.columns + (turn - window.column);
      for (std::int64_t column = in.west; column <= in.east; ++column) {
        const double sample = line[column];
        if (std::isnan(sample)) continue;
        gap = std::max(gap, surface.Apart({static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5}, sample));
      }
    }
    return gap;
  }
  Centres Clipped(Centres centres) const {
    if (!sheet_.wraps()) {
      centres.west = std::max<std::int64_t>(centres.west, 0);
      centres.east = std::min<std::int64_t>(centres.east, sheet_.columns() - 1);
    }
    centres.north = std::max<std::int64_t>(centres.north, 0);
    centres.south = std::min<std::int64_t>(centres.south, sheet_.rows() - 1);
    return centres;
  }

  // A cell whose bound, told from averages and tables, may be improved by reading its samples.
  struct LooseCell {
    TileCell cell;
    std::array<Position, 4> corners;
    Centres centres;
    double gap = 0;
  };
  // Of a group of cells: their samples are read together.
  struct LooseGroup {
    std::vector<LooseCell> cells;
    double gap = 0;
  };

  bool IsWorthReading(double gap) const {
    return trace_.factor > 1 && trace_.factor <= kMostRead && gap > tile_.bound_;
  }

  // Reads groups in the order of their bounds, until all others are below what is known anyway.
  Result<void> ReadLoose(const std::stop_token& stop) {
    std::ranges::stable_sort(loose_, std::ranges::greater(), &LooseGroup::gap);
    std::int64_t left = kMostSamples;
    for (const LooseGroup& group : loose_) {
      if (group.gap <= tile_.bound_) return {};
      Centres all{std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::max(),
                  std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::min()};
      for (const LooseCell& loose : group.cells) {
        const Centres in = Clipped(loose.centres);
        if (in.empty() || loose.gap <= tile_.bound_) continue;
        all = {std::min(all.west, in.west), std::min(all.north, in.north), std::max(all.east, in.east),
               std::max(all.south, in.south)};
      }
      if (all.empty()) continue;
      const GridWindow window{all.west, all.north, all.east - all.west + 1, all.south - all.north + 1};
      if (window.columns > left || window.rows > left || window.columns * window.rows > left) {
        Raise(group.gap);
        return {};
      }
      left -= window.columns * window.rows;
      const auto samples = sheet_.ReadSamples(window, stop);
      if (!samples) return tl::unexpected(samples.error());
      for (const LooseCell& loose : group.cells) {
        if (loose.gap <= tile_.bound_) continue;
        Raise(std::min(loose.gap, CentreGap(loose.cell, loose.corners, loose.centres, window, *samples, 0)));
      }
    }
    return {};
  }

  SourceGap& tile_;
  const Sheet& sheet_;
  const SheetTrace& trace_;
  const int cells_;
  const std::size_t stride_;
  static constexpr double kUnknown = std::numeric_limits<double>::infinity();

  // Averages of more samples are judged by tables, which are as fine. Of one tile no more samples are read than its own
  // heights may take.
  static constexpr int kMostRead = 16;
  static constexpr std::int64_t kMostSamples = std::int64_t{1} << 20;

  std::vector<LooseGroup> loose_;
  std::vector<std::size_t> near_;  // members
  HeightRange heights_;            // of all of them
  std::vector<double> x_, y_;      // by node, in samples of the grid; NaN away from its even part
};

SourceGap::SourceGap(const geo::Lattice& lattice, const NodeWindow& window, std::span<const float> heights, bool blends)
    : lattice_(lattice),
      window_(window),
      heights_(heights),
      blends_(blends),
      covered_(static_cast<std::size_t>(lattice.cells) * static_cast<std::size_t>(lattice.cells)) {}

Result<void> SourceGap::Add(const Sheet& sheet, const SheetTrace& trace, const std::stop_token& stop) {
  return SheetGap(*this, sheet, trace).Add(stop);
}

bool SourceGap::is_covered() const {
  return std::ranges::all_of(covered_, [](std::uint8_t covered) { return covered != 0; });
}

}  // namespace terrace::dem

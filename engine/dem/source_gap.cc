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
  }

  void Add() {
    for (int south = 0; south < cells_; south += kGroup) {
      for (int west = 0; west < cells_; west += kGroup) {
        AddGroup({west, south, std::min(west + kGroup, cells_), std::min(south + kGroup, cells_)});
      }
    }
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
    constexpr float kUnknown = std::numeric_limits<float>::infinity();
    if (sheet_.alignment() < factor) return kUnknown;
    const SheetMember* only = nullptr;
    for (const std::size_t i : near_) {
      const geo::TileRange pixels = sheet_.members()[i].pixels();
      if (east < static_cast<double>(pixels.start_x) || west > static_cast<double>(pixels.end_x + 1) ||
          south < static_cast<double>(pixels.start_y) || north > static_cast<double>(pixels.end_y + 1)) {
        continue;
      }
      if (only != nullptr) return kUnknown;
      only = &sheet_.members()[i];
    }
    if (only == nullptr) return 0;
    const RasterLayout& layout = only->raster->layout();
    const auto whole = [factor](int samples) { return static_cast<double>(samples / factor * factor); };
    const auto x = static_cast<double>(only->column), y = static_cast<double>(only->row);
    if (west < x || north < y || east > x + whole(layout.columns) || south > y + whole(layout.height)) return kUnknown;
    return only->raster->averaging_errors().Largest(factor, west - x, north - y, east - x, south - y);
  }

  // Of all rasters.
  HeightRange HeightsOf() const {
    HeightRange heights = sheet_.members().front().raster->info().heights;
    for (const SheetMember& member : sheet_.members()) {
      heights.min = std::min(heights.min, member.raster->info().heights.min);
      heights.max = std::max(heights.max, member.raster->info().heights.max);
    }
    return heights;
  }

  bool Touches(const CellBox& box) const {
    const double step = tile_.lattice_.StepDegrees();
    return sheet_.reach().Touches(tile_.lattice_.Longitude(tile_.window_.column + 1 + box.west),
                                  tile_.lattice_.Latitude(tile_.window_.row + 1 + box.south),
                                  step * (box.east - box.west), step * (box.north - box.south));
  }

  void AddGroup(const CellBox& box) {
    if (!Touches(box)) return;
    if (const double gap = SmoothGap(box); std::isfinite(gap)) {
      Raise(gap);
      for (int j = box.south; j < box.north; ++j) {
        std::fill_n(tile_.covered_.begin() + static_cast<std::ptrdiff_t>(CellIndex(box.west, j)), box.east - box.west,
                    1);
      }
      return;
    }
    for (int j = box.south; j < box.north; ++j) {
      for (int i = box.west; i < box.east; ++i) {
        if (tile_.covered_[CellIndex(i, j)] == 0) AddCell(i, j);
      }
    }
  }

  void AddCell(int i, int j) {
    const CellBox box{i, j, i + 1, j + 1};
    const std::size_t n = NodeOf(i, j);
    const std::array<std::size_t, 4> nodes = {n, n + 1, n + stride_, n + stride_ + 1};
    if (std::ranges::any_of(nodes, [&](std::size_t node) { return trace_.cell_of_node[node] < 0; })) {
      if (Touches(box)) Raise(RangeGap(nodes, j));
      return;
    }
    bool has_voids = false;
    double gap = SampleGap(nodes, has_voids);
    if (!has_voids) {
      tile_.covered_[CellIndex(i, j)] = 1;
      if (const double smooth = SmoothGap(box); smooth < gap) gap = smooth;
    }
    Raise(std::isfinite(gap) ? gap : RangeGap(nodes, j));
  }

  void Raise(double gap) { tile_.bound_ = std::max(tile_.bound_, gap); }

  // Between the heights served at a cell's nodes and heights within these bounds.
  double Apart(const std::array<std::size_t, 4>& nodes, double lowest, double highest) const {
    double gap = 0;
    for (const std::size_t node : nodes) {
      gap = std::max({gap, highest - double{tile_.heights_[node]}, double{tile_.heights_[node]} - lowest});
    }
    return gap;
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
  double SampleGap(const std::array<std::size_t, 4>& nodes, bool& has_voids) const {
    std::int64_t west = std::numeric_limits<std::int64_t>::max(), east = std::numeric_limits<std::int64_t>::min();
    std::int64_t north = west, south = east;
    for (const std::size_t node : nodes) {
      const GridCell& cell = trace_.cells[static_cast<std::size_t>(trace_.cell_of_node[node])];
      west = std::min(west, cell.column);
      east = std::max(east, cell.column + 1);
      north = std::min(north, cell.row);
      south = std::max(south, cell.row + 1);
    }
    const GridWindow& window = trace_.window;
    east = std::min(east, window.column + window.columns - 1);
    south = std::min(south, window.row + window.rows - 1);
    return BoxGap(nodes, west, north, east, south, has_voids);
  }

  // The same for averages in a box, ends included.
  double BoxGap(const std::array<std::size_t, 4>& nodes, std::int64_t west, std::int64_t north, std::int64_t east,
                std::int64_t south, bool& has_voids) const {
    double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
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
    if (lowest > highest) return averaging > 0 ? std::numeric_limits<double>::infinity() : 0;
    return Apart(nodes, lowest, highest) + averaging;
  }

  float SampleAt(std::int64_t column, std::int64_t row) const {
    const GridWindow& window = trace_.window;
    return trace_.samples[static_cast<std::size_t>((row - window.row) * window.columns + column - window.column)];
  }

  // Where the surface between samples and the one between nodes differ by no more than either bends; NaN or infinity
  // where the box is no such place.
  double SmoothGap(const CellBox& box) const {
    Steps steps;
    double west = std::numeric_limits<double>::infinity(), east = -west, north = west, south = -west;
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
        west = std::min(west, x), east = std::max(east, x);
        north = std::min(north, y), south = std::max(south, y);
      }
    }
    if (!std::isfinite(finite)) return std::numeric_limits<double>::quiet_NaN();
    // A line that bends by b per step is off its chord by b / 8; half as much again for how the bend itself changes, in
    // both directions. Positions are known to a hundred-thousandth.
    constexpr double kOffChord = 1.5 * 2 / 8, kPosition = 4e-5;
    steps.bend_x = steps.bend_x * kOffChord + kPosition;
    steps.bend_y = steps.bend_y * kOffChord + kPosition;
    Bends bends;
    const auto left = static_cast<std::int64_t>(std::floor(west)),
               right = static_cast<std::int64_t>(std::floor(east)) + 1;
    const auto top = static_cast<std::int64_t>(std::floor(north)),
               bottom = static_cast<std::int64_t>(std::floor(south)) + 1;
    if (!MeasureBends(left, top, right, bottom, bends)) return std::numeric_limits<double>::quiet_NaN();
    return LargestGap(bends, steps) + AveragingError(static_cast<double>(left), static_cast<double>(top),
                                                     static_cast<double>(right), static_cast<double>(bottom));
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
  double NearGap(const std::array<std::size_t, 4>& nodes, double west, double north, double east, double south) const {
    constexpr double kUnknown = std::numeric_limits<double>::infinity();
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
      return BoxGap(nodes, left + shift, top, right + shift, bottom, has_voids);
    }
    return kUnknown;
  }

  // Against everything that the raster has around the cell, or anywhere where its place cannot be told.
  double RangeGap(const std::array<std::size_t, 4>& nodes, int j) const {
    double west = std::numeric_limits<double>::infinity(), east = -west, north = west, south = -west;
    bool known = true;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      Position position = trace_.positions[nodes[k]];
      if (sheet_.georeference().is_geographic_grid()) {
        // All of a pole's nodes have one position: their columns are those of the row beside it.
        const std::int64_t row = tile_.window_.row + 1 + j + (k < 2 ? 0 : 1);
        if (row == 0 || row == tile_.lattice_.rows()) {
          position.x = trace_.positions[nodes[k] + (k < 2 ? stride_ : 0) - (k < 2 ? 0 : stride_)].x;
        }
        const double turn = sheet_.georeference().period();
        position.x += turn * std::round((sheet_.columns() / 2.0 - position.x) / turn);
      }
      known &= std::isfinite(position.x) && std::isfinite(position.y);
      west = std::min(west, position.x), east = std::max(east, position.x);
      north = std::min(north, position.y), south = std::max(south, position.y);
    }
    if (!known) {
      const HeightRange heights = HeightsOf();
      return Apart(nodes, heights.min, heights.max);
    }
    // Edges of cells bulge by far less. The samples are at the pixels' centres.
    constexpr double kBulge = 1.0 / 32;
    const double x = (east - west) * kBulge, y = (south - north) * kBulge;
    const auto first = [](double at) { return std::ceil(at - 0.5); };
    const auto last = [](double at) { return std::floor(at - 0.5); };
    if (first(north - y) > last(south + y)) return 0;
    if (const double gap = NearGap(nodes, west - x, north - y, east + x, south + y); std::isfinite(gap)) return gap;
    BlockRange range;
    for (const int turn : {-1, 0, 1}) {
      if (turn != 0 && !sheet_.wraps()) continue;
      const double shift = static_cast<double>(turn) * sheet_.columns();
      if (first(west - x + shift) > last(east + x + shift)) continue;
      range.Add(Ranges(first(west - x + shift), first(north - y), last(east + x + shift), last(south + y)));
    }
    return range.min > range.max ? 0 : Apart(nodes, range.min, range.max);
  }

  SourceGap& tile_;
  const Sheet& sheet_;
  const SheetTrace& trace_;
  const int cells_;
  const std::size_t stride_;
  std::vector<std::size_t> near_;  // members
  std::vector<double> x_, y_;      // by node, in samples of the grid; NaN away from its even part
};

SourceGap::SourceGap(const geo::Lattice& lattice, const NodeWindow& window, std::span<const float> heights)
    : lattice_(lattice),
      window_(window),
      heights_(heights),
      covered_(static_cast<std::size_t>(lattice.cells) * static_cast<std::size_t>(lattice.cells)) {}

void SourceGap::Add(const Sheet& sheet, const SheetTrace& trace) { SheetGap(*this, sheet, trace).Add(); }

bool SourceGap::is_covered() const {
  return std::ranges::all_of(covered_, [](std::uint8_t covered) { return covered != 0; });
}

}  // namespace terrace::dem

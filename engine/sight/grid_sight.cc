#include "engine/sight/grid_sight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "engine/raster/grid_cells.h"
#include "engine/sight/step_clearance.h"

namespace terrace::dem {
namespace {

// Samples: parts of a ray that cross at most this many are measured.
constexpr double kMeasured = 2;
// Metres: with undulations that are not in the blocks, parts are at most this long.
constexpr double kUndulationPart = 500;
// Samples between places that are measured first.
constexpr double kProbes = 24;
// Samples: parts of a ray that cross at most this many, none of them void, are walked along.
constexpr double kWalked = 256;
// Metres: over the rounding of heights.
constexpr double kSlack = 1e-6;
// Parts of a cell with voids: its heights are no polynomial.
constexpr int kRimParts = 16;
// Of a part: a stretch without heights that is shorter is one place.
constexpr double kPlace = 1e-6;

double Lerp(double first, double second, double weight) { return first + weight * (second - first); }

// The first place where a part of less than a block crosses a line between two blocks; its end if it crosses none.
double FirstBlockLine(const PieceOnGrid& on_grid, double first, double last) {
  double at = last;
  for (const Quadratic* const axis : {&on_grid.x, &on_grid.y}) {
    const double from = std::floor(axis->At(first) / kPointBlockCells),
                 to = std::floor(axis->At(last) / kPointBlockCells);
    if (from != to) at = std::min(at, axis->Solve(std::max(from, to) * kPointBlockCells, first, last));
  }
  return at;
}

// The first place below the tolerance between one above it and one below it.
template <typename Clearance>
double FirstBelow(const Clearance& clearance, double above, double below) {
  for (int step = 0; step < 40 && above < below; ++step) {
    const double half = (above + below) / 2;
    (clearance(half) < -kSightTolerance ? below : above) = half;
  }
  return below;
}

}  // namespace

// One piece of a ray over the grid. `s`: 0 .. 1 along the piece.
struct GridSight::Scan {
  const TrackPiece& piece;
  const PieceOnGrid& on_grid;
  SightSurface surface;
  SightSearch& search;
  std::vector<RayPart>& without_height;  // the result of Search
  const std::stop_token& stop;

  double ShareOf(double s) const { return Lerp(piece.start, piece.end, s); }
  void AddWithoutHeight(double first, double last) {
    const double start = ShareOf(first), end = ShareOf(last);
    if (!without_height.empty() && without_height.back().end >= start) {
      without_height.back().end = std::max(without_height.back().end, end);
    } else {
      without_height.push_back({start, end});
    }
  }
  // Measures a short part with heights, whose clearance is no polynomial but has one lowest place at most.
  template <typename Clearance>
  void MeasureSmooth(const Clearance& clearance, double first, double last);
};

template <typename Clearance>
void GridSight::Scan::MeasureSmooth(const Clearance& clearance, double first, double last) {
  const auto at = [&](double s) { return clearance(s).value_or(std::numeric_limits<double>::infinity()); };
  const Quadratic over(at(first), at((first + last) / 2), at(last));
  double lowest = first;
  if (over.Slope(0) < 0 && over.Slope(1) > 0) {
    double low = first, high = last;
    for (int step = 0; step < 30; ++step) {
      const double left = Lerp(low, high, 0.38), right = Lerp(low, high, 0.62);
      const bool is_on_left = at(left) < at(right);
      (is_on_left ? high : low) = is_on_left ? right : left;
    }
    lowest = (low + high) / 2;
  }
  double above = first;
  for (const double s : {first, lowest, last}) {
    const double clearance_m = at(s);
    search.Add(clearance_m, ShareOf(s));
    if (clearance_m >= -kSightTolerance) {
      above = s;
    } else {
      search.AddBlocked(ShareOf(FirstBelow(at, above, s)));
    }
  }
}

Result<std::vector<RayPart>> GridSight::Search(std::span<const TrackPiece> pieces, std::span<const RayPart> parts,
                                               SightSurface surface, SightSearch& search, const std::stop_token& stop) {
  const std::vector<PieceOnGrid> on_grid = OnGrid(pieces, grid_.georeference());
  std::vector<RayPart> without_height;
  // If no raster grid comes before this one, all of its heights count.
  const bool is_first = parts.size() == 1 && parts[0].start == 0 && parts[0].end == 1;
  if (is_first) {
    for (const PieceOnGrid& piece : on_grid) {
      Scan scan{piece.track, piece, surface, search, without_height, stop};
      if (const Result<void> done = Probe(scan); !done) return tl::unexpected(done.error());
    }
  }
  auto part = parts.begin();
  for (const PieceOnGrid& piece_on_grid : on_grid) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "looking along a ray was stopped");
    const TrackPiece& piece = piece_on_grid.track;
    Scan scan{piece, piece_on_grid, surface, search, without_height, stop};
    const double length = piece.end - piece.start;
    while (part != parts.end() && part->end <= piece.start && part + 1 != parts.end()) ++part;
    for (auto p = part; p != parts.end() && p->start <= piece.end; ++p) {
      const double first = std::clamp((p->start - piece.start) / length, 0.0, 1.0);
      const double last = std::clamp((p->end - piece.start) / length, 0.0, 1.0);
      if (first > last || (first == last && p->start != p->end)) continue;
      if (const Result<void> done = Halve(scan, first, last); !done) return tl::unexpected(done.error());
    }
  }
  return without_height;
}

std::int64_t GridSight::WrappedColumn(std::int64_t column) const {
  return grid_.wraps() ? FloorMod(column, grid_.columns()) : column;
}

// The cells of positions on the grid. Positions beyond the outermost centres belong to the outermost cells.
GridSight::CellRange GridSight::CellsOf(const Quadratic::Range& x, const Quadratic::Range& y) const {
  const auto cell = [](double position, std::int64_t cells) {
    return std::clamp(static_cast<std::int64_t>(std::floor(position)), std::int64_t{0},
                      std::max(cells - 1, std::int64_t{0}));
  };
  const std::int64_t rows = grid_.rows() - 1;
  if (grid_.wraps()) {
    return {static_cast<std::int64_t>(std::floor(x.min)), cell(y.min, rows),
            static_cast<std::int64_t>(std::floor(x.max)), cell(y.max, rows)};
  }
  const std::int64_t columns = grid_.columns() - 1;
  return {cell(x.min, columns), cell(y.min, rows), cell(x.max, columns), cell(y.max, rows)};
}

// Measures some places first: the lower the smallest clearance is, the more of a ray can be skipped.
Result<void> GridSight::Probe(Scan& scan) {
  const double samples = std::max(std::abs(scan.on_grid.x.At(1) - scan.on_grid.x.At(0)),
                                  std::abs(scan.on_grid.y.At(1) - scan.on_grid.y.At(0)));
  if (!(samples > kProbes) || grid_.wraps()) return {};
  const int count = static_cast<int>(std::min(samples / kProbes, 1000.0));
  for (int i = 0; i < count; ++i) {
    const double s = (i + 0.5) / count, x = scan.on_grid.x.At(s), y = scan.on_grid.y.At(s);
    const bool is_between = x >= 0 && y >= 0 && x < grid_.columns() - 1 && y < grid_.rows() - 1;
    if (!is_between ||
        scan.search.IsSettled(scan.piece.height_m.At(s) - grid_.heights().max - SightBlocks::kMaxUndulation, 0))
      continue;
    const auto column = static_cast<std::int64_t>(x), row = static_cast<std::int64_t>(y);
    blocks_.Trim();
    const Result<const SightBlock*> block = blocks_.At(column, row, scan.stop);
    if (!block) return tl::unexpected(block.error());
    const GridWindow& window = (*block)->window();
    const auto at = static_cast<std::size_t>((row - window.row) * window.columns + column - window.column);
    const auto south = static_cast<std::size_t>(window.columns);
    const float* const heights = (*block)->heights().data() + at;
    const float* const bridged = (*block)->bridged().data() + at;
    const double east_of = x - static_cast<double>(column), south_of = y - static_cast<double>(row);
    double ground =
        Lerp(Lerp(heights[0], heights[1], east_of), Lerp(heights[south], heights[south + 1], east_of), south_of);
    if (std::isnan(ground + bridged[0] + bridged[1] + bridged[south] + bridged[south + 1])) continue;
    if (!blocks_.includes_undulations()) {
      ground += blocks_.Undulation({scan.piece.longitude.At(s), scan.piece.latitude.At(s)});
    }
    const double clearance_m = scan.piece.height_m.At(s) - ground;
    scan.search.Add(clearance_m, scan.ShareOf(s));
    if (clearance_m < -kSightTolerance) scan.search.AddBlocked(scan.ShareOf(s));
  }
  return {};
}

// Measuring may end the lifetime of a block: halves are measured after the last use of the block of the whole.
Result<void> GridSight::Halve(Scan& scan, double first, double last) {
  blocks_.Trim();
  const Quadratic::Range x = scan.on_grid.x.Over(first, last), y = scan.on_grid.y.Over(first, last);
  constexpr double kRim = 0.5 + GridCover::kEdgeTolerance;
  const bool is_beside = (!grid_.wraps() && (x.max < -kRim || x.min > grid_.columns() - 1 + kRim)) || y.max < -kRim ||
                         y.min > grid_.rows() - 1 + kRim;
  // A position that the CRS does not have is not on the grid either.
  if (is_beside || !(x.min <= x.max) || !(y.min <= y.max)) {
    scan.AddWithoutHeight(first, last);
    return {};
  }
  const double height_m = scan.piece.height_m.Over(first, last).min;
  const double size = std::max(x.max - x.min, y.max - y.min);
  const double slack_m = blocks_.includes_undulations() ? 0 : SightBlocks::kMaxUndulation;
  const CellRange cells = CellsOf(x, y);
  const std::int64_t west = WrappedColumn(cells.west), east = west + cells.east - cells.west;
  const bool is_in_block = (west / kPointBlockCells == east / kPointBlockCells) && east < grid_.columns() &&
                           cells.north / kPointBlockCells == cells.south / kPointBlockCells;
  CellsBound bound{0, true};
  const SightBlock* within = nullptr;
  if (is_in_block) {
    const Result<const SightBlock*> block = blocks_.At(west, cells.north, scan.stop);
    if (!block) return tl::unexpected(block.error());
    within = *block;
    bound = within->Over(west, cells.north, east, cells.south);
  } else if (east < grid_.columns() && size > kPointBlockCells / 8) {
    // Without reading the samples.
    const BlockRange range = grid_.Ranges({static_cast<double>(west), static_cast<double>(cells.north),
                                           static_cast<double>(east + 2), static_cast<double>(cells.south + 2)});
    const float geoid_m = grid_.vertical().geoid ? static_cast<float>(SightBlocks::kMaxUndulation) : 0;
    bound = {range.max + geoid_m, range.has_voids};
  }
  // Beside the raster other raster grids may have heights.
  bound.has_voids |=
      (!grid_.wraps() && (x.min < -0.5 || x.max > grid_.columns() - 0.5)) || y.min < -0.5 || y.max > grid_.rows() - 0.5;
  if (!bound.has_voids && scan.search.IsSettled(height_m - bound.max - slack_m, scan.ShareOf(first))) return {};
  if (is_in_block && bound.max == -std::numeric_limits<float>::infinity()) {
    scan.AddWithoutHeight(first, last);
    return {};
  }
  const bool is_between = x.min >= 0 && y.min >= 0 && x.max <= grid_.columns() - 1 && y.max <= grid_.rows() - 1;
  if (within != nullptr && size <= kWalked && !bound.has_voids && is_between && blocks_.includes_undulations()) {
    return Walk(scan, *within, {west, cells.north, east, cells.south}, static_cast<double>(cells.west - west), first,
                last, size);
  }
  const double length_m = (last - first) * scan.piece.length_m;
  if (size <= kMeasured && (blocks_.includes_undulations() || length_m <= kUndulationPart)) {
    return Measure(scan, first, last);
  }
  // Where a part crosses a line between two blocks, it is divided there instead of in many halves.
  if (!is_in_block && size <= kPointBlockCells && size > kMeasured && !grid_.wraps()) {
    const double at = FirstBlockLine(scan.on_grid, first, last), beside = (last - first) * 0.25 / size;
    if (at > first && at < last) {
      const double before = std::max(first, at - beside), after = std::min(last, at + beside);
      if (before > first) {
        if (const Result<void> done = Halve(scan, first, before); !done) return done;
      }
      if (const Result<void> done = Halve(scan, before, after); !done) return done;
      return after < last ? Halve(scan, after, last) : Result<void>();
    }
  }
  const double middle = (first + last) / 2;
  if (const Result<void> done = Halve(scan, first, middle); !done) return done;
  return Halve(scan, middle, last);
}

// Steps of less than a sample lie in 2 x 2 cells. A step is measured unless it is above their largest corner, or above
// their surface. `cells`: below the part, none with a void, of the turn around the Earth that the block is in; `turn`:
// columns from it to the part.
Result<void> GridSight::Walk(Scan& scan, const SightBlock& block, const CellRange& cells, double turn, double first,
                             double last, double size) {
  // With A = factor (last - first)^2, a step is at most (size + A) / count long, and its polynomial at most
  // A / (4 count^2) beside its chord.
  const double factor = std::max(std::abs(scan.on_grid.x.square_factor()), std::abs(scan.on_grid.y.square_factor()));
  const int count = static_cast<int>((size + 4 * factor * (last - first) * (last - first)) * 1.125) + 1;
  const double step = (last - first) / count;
  const auto bulge = [step](const Quadratic& q) { return std::abs(q.square_factor()) * step * step / 4; };
  const Quadratic on_x = scan.on_grid.x, on_y = scan.on_grid.y, height_m = scan.piece.height_m;
  const GridWindow& window = block.window();
  const double west = static_cast<double>(window.column) + turn + bulge(on_x) + kSlack;
  const double north = static_cast<double>(window.row) + bulge(on_y) + kSlack;
  const double slack_m = bulge(height_m) + kSlack;
  // The surface is nowhere steeper than all of its relief in a sample.
  const double relief_m = grid_.heights().max - grid_.heights().min + 2 * SightBlocks::kMaxUndulation;
  const double beside_m = (bulge(on_x) + bulge(on_y)) * relief_m;
  const double back_x = bulge(on_x) + kSlack, back_y = bulge(on_y) + kSlack;
  const SampleView samples{block.heights().data(),     window.columns,
                           cells.west - window.column, cells.north - window.row,
                           cells.east - window.column, cells.south - window.row};
  const bool has_cells = window.columns > 1 && window.rows > 1;
  const float* const largest = block.largest().data();
  const std::int64_t stride = window.columns;
  double s = first, x = on_x.At(s) - west, y = on_y.At(s) - north, h = height_m.At(s) - slack_m;
  // Whether `steps` steps from here lie above the highest corner of the square of cells around them, which is known to
  // contain them. Then goes behind them.
  const auto skips = [&](int i, int steps, const SightBlock::Squares& squares) {
    const double more = static_cast<double>(steps) * steps - 1;  // bulges grow with the square of the length
    const int end = std::min(i + steps, count);
    const double next = end == count ? last : first + step * end;
    const double next_x = on_x.At(next) - west, next_y = on_y.At(next) - north, next_h = height_m.At(next) - slack_m;
    const auto column = static_cast<std::int64_t>(std::max(std::min(x, next_x) - more * bulge(on_x), 0.0));
    const auto row = static_cast<std::int64_t>(std::max(std::min(y, next_y) - more * bulge(on_y), 0.0));
    const double lowest_m = std::min(h, next_h) - more * bulge(height_m);
    const double highest_m = static_cast<double>(squares.At(column, row));
    if (!scan.search.IsSettled(lowest_m - highest_m, scan.ShareOf(s))) return false;
    s = next, x = next_x, y = next_y, h = next_h;
    return true;
  };
  // Steps are at most 8/9 of a sample long, so runs of 4 and 8 keep this much of their squares' sides on both sides.
  const bool has_runs = 64 * std::max(bulge(on_x), bulge(on_y)) < 0.2;
  for (int i = 1; i <= count; ++i) {
    if (has_runs && i % 8 == 1 && skips(i - 1, 8, block.squares_of_8())) {
      i += 7;
      continue;
    }
    if (has_runs && i % 4 == 1 && skips(i - 1, 4, block.squares_of_4())) {
      i += 3;
      continue;
    }
    const double next = i == count ? last : first + step * i;
    const double next_x = on_x.At(next) - west, next_y = on_y.At(next) - north, next_h = height_m.At(next) - slack_m;
    // Positions before the window's first sample are cut off by no more than the bulge.
    const auto column = static_cast<std::int64_t>(std::max(std::min(x, next_x), 0.0));
    const auto row = static_cast<std::int64_t>(std::max(std::min(y, next_y), 0.0));
    const auto highest = static_cast<double>(largest[row * stride + column]);
    const auto is_settled = [&](double clearance_m) { return scan.search.IsSettled(clearance_m, scan.ShareOf(s)); };
    if (!is_settled(std::min(h, next_h) - highest)) {
      const RayPlace from{x + back_x, y + back_y, h}, to{next_x + back_x, next_y + back_y, next_h};
      if (!has_cells || !is_settled(LeastClearance(samples, from, to) - beside_m)) {
        if (const Result<void> done = Measure(scan, s, next); !done) return done;
      }
    }
    s = next, x = next_x, y = next_y, h = next_h;
  }
  return {};
}

// Divides a part where it crosses the lines of the grid.
Result<void> GridSight::Measure(Scan& scan, double first, double last) {
  std::array<double, 16> at{};
  std::size_t count = 0;
  at[count++] = first;
  const std::array<std::pair<const Quadratic*, std::int64_t>, 2> axes = {
      std::pair(&scan.on_grid.x, std::int64_t{grid_.columns()}),
      std::pair(&scan.on_grid.y, std::int64_t{grid_.rows()})};
  for (const auto& [axis, samples] : axes) {
    const Quadratic::Range range = axis->Over(first, last);
    for (double line = std::ceil(range.min); line <= range.max && count + 1 < at.size(); ++line) {
      at[count++] = axis->Solve(line, first, last);
    }
    // Beyond the outermost samples the heights are those of the rim.
    for (const double rim : {-0.5, static_cast<double>(samples) - 0.5}) {
      if (rim > range.min && rim < range.max && count + 1 < at.size()) at[count++] = axis->Solve(rim, first, last);
    }
  }
  at[count++] = last;
  std::sort(at.begin(), at.begin() + static_cast<std::ptrdiff_t>(count));
  for (std::size_t i = 0; i + 1 < count; ++i) {
    if (at[i] == at[i + 1] && count > 2) continue;
    if (const Result<void> done = MeasureInCell(scan, at[i], at[i + 1]); !done) return done;
  }
  return {};
}

bool GridSight::IsInside(const Scan& scan, double s) const {
  Position pixel{scan.on_grid.x.At(s) + 0.5, scan.on_grid.y.At(s) + 0.5};
  if (grid_.wraps()) pixel.x -= std::floor(pixel.x / grid_.columns()) * grid_.columns();
  return grid_.Covers(pixel);
}

Result<void> GridSight::MeasureInCell(Scan& scan, double first, double last) {
  const double middle = (first + last) / 2;
  const double x = scan.on_grid.x.At(middle), y = scan.on_grid.y.At(middle);
  const CellRange cell = CellsOf({x, x}, {y, y});
  const std::int64_t column = WrappedColumn(cell.west), row = cell.north;
  const Result<const SightBlock*> found = blocks_.At(column, row, scan.stop);
  if (!found) return tl::unexpected(found.error());
  const SightBlock& block = **found;
  const GridWindow& window = block.window();
  const std::size_t at = static_cast<std::size_t>((row - window.row) * window.columns + column - window.column);
  const std::size_t east = window.columns > 1 ? 1 : 0;
  const std::size_t south = window.rows > 1 ? static_cast<std::size_t>(window.columns) : 0;
  const float* const heights = block.heights().data() + at;
  const double nw = heights[0], ne = heights[east], sw = heights[south], se = heights[south + east];
  const float* const bridged = block.bridged().data() + at;
  const double all = nw + ne + sw + se +
                     (scan.surface == SightSurface::kNotHoles
                          ? 0.0 * (bridged[0] + bridged[east] + bridged[south] + bridged[south + east])
                          : 0.0);
  // The lowest place of a ray in a cell may lie below both ends of its part. None of the surface lies above the largest
  // corner.
  const double length = last - first, sag_m = std::abs(scan.piece.height_m.square_factor()) * length * length / 4;
  const double slack_m = sag_m + (blocks_.includes_undulations() ? kSlack : SightBlocks::kMaxUndulation);
  const double lowest_m = std::min(scan.piece.height_m.At(first), scan.piece.height_m.At(last));
  const double highest_m = std::fmax(std::fmax(nw, ne), std::fmax(sw, se));  // without voids
  const bool is_settled = scan.search.IsSettled(lowest_m - highest_m - slack_m, scan.ShareOf(first));
  const bool is_rim = (!grid_.wraps() && (x < 0 || x > grid_.columns() - 1)) || y < 0 || y > grid_.rows() - 1;
  if (std::isnan(all) || (is_rim && !IsInside(scan, middle))) {
    MeasureRim(scan, block, column, row, first, last, is_settled);
    return {};
  }
  if (is_settled) return {};
  const auto clearance = [&](double s) {
    const double east_of = std::clamp(scan.on_grid.x.At(s) - static_cast<double>(cell.west), 0.0, 1.0);
    const double south_of = std::clamp(scan.on_grid.y.At(s) - static_cast<double>(row), 0.0, 1.0);
    double ground = Lerp(Lerp(nw, ne, east_of), Lerp(sw, se, east_of), south_of);
    if (!blocks_.includes_undulations()) {
      ground += blocks_.Undulation({scan.piece.longitude.At(s), scan.piece.latitude.At(s)});
    }
    return scan.piece.height_m.At(s) - ground;
  };
  const double at_first = clearance(first), at_middle = clearance(middle), at_last = clearance(last);
  const Quadratic over(at_first, at_middle, at_last);
  scan.search.Add(at_first, scan.ShareOf(first));
  scan.search.Add(at_last, scan.ShareOf(last));
  // Not by values: rounding may make one of the polynomial lower than both ends where it has no lowest place between.
  const bool is_lowest_between = over.Slope(0) < 0 && over.Slope(1) > 0;
  const double lowest = is_lowest_between ? std::clamp(-over.Slope(0) / (2 * over.square_factor()), 0.0, 1.0) : 1;
  if (is_lowest_between) scan.search.Add(over.At(lowest), scan.ShareOf(Lerp(first, last, lowest)));
  const bool is_blocked = std::min({at_first, at_last, over.At(lowest)}) < -kSightTolerance;
  if (!is_blocked || scan.search.IsBlockedBefore(scan.ShareOf(first))) return {};
  // The first place below the tolerance.
  double place = 0;
  if (at_first >= -kSightTolerance) {
    place = FirstBelow([&](double share) { return over.At(share); }, 0, at_last < -kSightTolerance ? 1 : lowest);
  }
  scan.search.AddBlocked(scan.ShareOf(Lerp(first, last, place)));
  return {};
}

// In a cell with voids the weights of the other samples count, as for heights at points (Interpolate). If the part
// `is_settled`, only looks for places without a height.
void GridSight::MeasureRim(Scan& scan, const SightBlock& block, std::int64_t column, std::int64_t row, double first,
                           double last, bool is_settled) {
  const double x = scan.on_grid.x.At((first + last) / 2);
  const double turn = std::floor(x) - static_cast<double>(column);  // whole turns, where columns wrap
  const double shift = grid_.wraps() ? turn : 0;
  const auto clearance = [&](double s) -> std::optional<double> {
    const GridCell cell{column, row, std::clamp(scan.on_grid.x.At(s) - shift - static_cast<double>(column), 0.0, 1.0),
                        std::clamp(scan.on_grid.y.At(s) - static_cast<double>(row), 0.0, 1.0)};
    const bool is_owned =
        IsInside(scan, s) && (scan.surface == SightSurface::kAll || HasSample(block.bridged(), block.window(), cell));
    const auto height = is_owned ? Interpolate(block.heights(), block.window(), cell) : std::nullopt;
    if (!height) return std::nullopt;
    const double undulation_m = blocks_.includes_undulations()
                                    ? 0
                                    : blocks_.Undulation({scan.piece.longitude.At(s), scan.piece.latitude.At(s)});
    return scan.piece.height_m.At(s) - *height - undulation_m;
  };
  double before = first;
  bool is_known = clearance(first).has_value();
  for (int i = 1; i <= kRimParts; ++i) {
    const double s = Lerp(first, last, static_cast<double>(i) / kRimParts);
    const bool is_next_known = clearance(s).has_value();
    // Where the heights end or begin.
    double with = is_known ? before : s, without = is_known ? s : before;
    for (int step = 0; step < 30 && is_known != is_next_known; ++step) {
      const double edge = (with + without) / 2;
      (clearance(edge) ? with : without) = edge;
    }
    // A single place: beyond the outermost samples, and along a line of them, only the place of a void has no height.
    const bool is_place = std::abs(without - (is_known ? s : before)) <= kPlace * (s - before);
    if (is_known && is_next_known) {
      if (!is_settled) scan.MeasureSmooth(clearance, before, s);
    } else if (is_known) {
      if (!is_settled) scan.MeasureSmooth(clearance, before, with);
      if (!is_place) scan.AddWithoutHeight(without, s);
    } else if (is_next_known) {
      if (!is_place) scan.AddWithoutHeight(before, without);
      if (!is_settled) scan.MeasureSmooth(clearance, with, s);
    } else {
      scan.AddWithoutHeight(before, s);
    }
    is_known = is_next_known;
    before = s;
  }
}

std::size_t GridSights::blocks() const {
  std::size_t blocks = 0;
  for (const auto& [number, sight] : sights_) blocks += sight.blocks();
  return blocks;
}

GridSight& GridSights::Of(std::size_t number, const RasterGrid& grid) {
  if (sights_.size() + blocks() > kMaxSightBlocks) sights_.clear();
  return sights_.try_emplace(number, grid).first->second;
}

}  // namespace terrace::dem

// From a window of nodes to heights: positions, window, voids, interpolation. Every step is a function of the global
// node, the level and the raster grid; the window decides only what is read, never what comes out.
#include "engine/dem/mosaic/raster_grid.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/dem/crs/node_positions.h"
#include "engine/dem/mosaic/feather.h"
#include "engine/dem/mosaic/void_fill.h"
#include "engine/dem/raster/grid_cells.h"
#include "engine/geo/tile_cover.h"

namespace terrace::dem {
namespace {

// Interpolated positions are this close to exact ones, in samples of the grid they are read from: a slope of 45 degrees
// at 30 m turns it into 0.3 mm.
constexpr double kGridPositionTolerance = 1e-5;
// Positions this close to the raster's edge, in pixels, are on it.
constexpr double kGridEdgeTolerance = 1e-6;

// Pixels that the members have, columns of raster grids that wrap counted from 0 to `turn`; without overlap.
std::vector<geo::TileRange> CoverOf(const std::vector<GridMember>& members, std::int64_t turn) {
  std::vector<geo::TileRange> ranges;
  for (const GridMember& member : members) {
    const geo::TileRange pixels = member.pixels();
    ranges.push_back(pixels);
    if (turn > 0 && pixels.end_x >= turn) {
      ranges.push_back({0, pixels.start_y, std::min(pixels.end_x, 2 * turn - 1) - turn, pixels.end_y});
    }
  }
  return geo::Disjoint(std::move(ranges));
}

Box BoxOf(const geo::TileRange& pixels) {
  return {static_cast<double>(pixels.start_x), static_cast<double>(pixels.start_y),
          static_cast<double>(pixels.end_x + 1), static_cast<double>(pixels.end_y + 1)};
}

// Whether positions lie in one of the boxes that pixels are covered by. For one thread.
class InsideTest {
 public:
  // `hull`: of all positions that are asked about. What these refer to outlives it.
  InsideTest(const std::vector<geo::TileRange>& cover, const BoxIndex& index, const Box& hull)
      : cover_(cover), index_(index), near_(index.Find(Grown(hull))) {}

  bool operator()(const Position& p) const {
    // Neighbours mostly lie in one box.
    if (Holds(last_, p)) return true;
    if (std::isnan(p.x) || std::isnan(p.y)) return false;
    // Boxes reach farther than by the tolerance here: Holds decides.
    if (near_.size() <= kFewBoxes) return HoldsAny(near_, p);
    return HoldsAny(index_.Find(Grown({p.x, p.y, p.x, p.y})), p);
  }

 private:
  // Up to so many are asked in turn; of more the index tells which.
  static constexpr std::size_t kFewBoxes = 8;

  static Box Grown(const Box& box) {
    constexpr double kHalo = 2 * kGridEdgeTolerance;
    return {box.west - kHalo, box.south - kHalo, box.east + kHalo, box.north + kHalo};
  }
  static bool Holds(const Box& box, const Position& p) {
    return p.x >= box.west && p.x <= box.east && p.y >= box.south && p.y <= box.north;
  }
  bool HoldsAny(const std::vector<std::size_t>& blocks, const Position& p) const {
    for (const std::size_t block : blocks) {
      const Box box = BoxOf(cover_[block]);
      const Box reach{box.west - kGridEdgeTolerance, box.south - kGridEdgeTolerance, box.east + kGridEdgeTolerance,
                      box.north + kGridEdgeTolerance};
      if (!Holds(reach, p)) continue;
      last_ = reach;
      return true;
    }
    return false;
  }

  const std::vector<geo::TileRange>& cover_;
  const BoxIndex& index_;
  const std::vector<std::size_t> near_;
  mutable Box last_{1, 1, 0, 0};  // as it begins: none
};

Result<Georeference> GeoreferenceOf(const GridPlan& plan) {
  if (plan.members.size() == 1) return plan.members.front().raster->georeference();
  // That of the member in the corner, if there is one, goes over as it is.
  const auto corner =
      std::ranges::find_if(plan.members, [](const GridMember& m) { return m.column == 0 && m.row == 0; });
  const GridMember& member = corner != plan.members.end() ? *corner : plan.members.front();
  return member.raster->georeference().Moved({-member.column, -member.row}, plan.width, plan.height,
                                             member.raster->info().path);
}

bool IsVoid(float height) { return std::isnan(height); }

}  // namespace

float RoundHeight(double metres) { return static_cast<float>(std::nearbyint(metres * 1024) / 1024); }

Result<RasterGrid> RasterGrid::Make(GridPlan plan, const GridOptions& options) {
  auto where = GeoreferenceOf(plan);
  if (!where) return tl::unexpected(where.error());
  RasterGrid grid(*std::move(where));
  grid.members_ = std::move(plan.members);
  grid.options_ = options;
  grid.width_ = plan.width;
  grid.height_ = plan.height;
  grid.wraps_ = grid.georeference_.wrap_columns() > 0;
  grid.columns_ = grid.wraps_ ? grid.georeference_.wrap_columns() : plan.width;
  const RasterSource& first = *grid.members_.front().raster;
  // Members far apart may have nothing of the Earth half way between them.
  grid.spacing_ = SourceSpacing::Of(grid.georeference_, first.info().path).value_or(first.spacing());
  grid.reach_ = Footprint::Of(grid.georeference_).Padded();
  grid.IndexMembers();
  grid.MeasureMembers();
  grid.FindPoleHeights();
  if (options.voids == HoleFill::kSmooth) {
    grid.voids_ = GridVoids(grid.members_, grid.member_index_, grid.wraps_ ? grid.columns_ : 0);
  }
  if (const auto& geoid = grid.vertical().geoid) {
    auto undulations = Undulations::Of(geoid, grid.reach_);
    if (!undulations) return tl::unexpected(undulations.error());
    grid.undulations_ = *std::move(undulations);
  }
  return grid;
}

void RasterGrid::IndexMembers() {
  const std::int64_t turn = wraps_ ? columns_ : 0;
  alignment_ = 1 << 22;  // AveragingFactor's largest
  heights_ = members_.front().raster->info().heights;
  std::vector<BoxIndex::Entry> entries, blocks;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const GridMember& member = members_[i];
    const HeightRange& heights = member.raster->info().heights;
    heights_ = {std::min(heights_.min, heights.min), std::max(heights_.max, heights.max)};
    while (member.column % alignment_ != 0 || member.row % alignment_ != 0 || (turn > 0 && turn % alignment_ != 0)) {
      alignment_ /= 2;
    }
    const Box box = BoxOf(member.pixels());
    for (const std::int64_t shift : {std::int64_t{0}, -turn, turn}) {
      const auto x = static_cast<double>(shift);
      entries.push_back({{box.west + x, box.south, box.east + x, box.north}, i});
      if (turn == 0) break;
    }
  }
  cover_ = CoverOf(members_, turn);
  for (std::size_t i = 0; i < cover_.size(); ++i) blocks.push_back({BoxOf(cover_[i]), i});
  member_index_ = BoxIndex(entries);
  cover_index_ = BoxIndex(blocks);
}

// Rasters are joined that lie a little off one grid. They are read as if they were on it; the bound on a tile's error
// knows better.
void RasterGrid::MeasureMembers() {
  // Around the Earth 360 degrees count as whole columns: where the raster grid closes its surface leaps by what is
  // left, and columns beyond lie off by as much.
  const double seam = wraps_ ? 2 * std::abs(georeference_.period() - columns_) : 0;
  for (GridMember& member : members_) {
    if (members_.size() > 1) {
      member.misplacement =
          georeference_.LargestMisplacement(member.raster->georeference(), {member.column, member.row});
    }
    member.misplacement.x += seam;
  }
}

// The mean of the rows that lie at a pole, of members by their width.
void RasterGrid::FindPoleHeights() {
  if (!georeference_.is_geographic_grid()) return;
  for (const int pole : {0, 1}) {
    Position position{0, pole == 0 ? -90.0 : 90.0};
    georeference_.ToPixels({&position, 1});
    if (!(position.y >= -kGridEdgeTolerance && position.y <= height_ + kGridEdgeTolerance)) continue;
    const bool first_row = position.y < height_ / 2.0;
    double sum = 0, weights = 0;
    for (const GridMember& member : members_) {
      const RasterLayout& layout = member.raster->layout();
      if (first_row ? member.row != 0 : member.row + layout.height != height_) continue;
      const auto& mean = member.raster->edge_row_means()[first_row ? 0 : 1];
      if (!mean) continue;
      const double weight = members_.size() == 1 ? 1 : layout.columns;
      sum += weight * *mean;
      weights += weight;
    }
    if (weights > 0) pole_heights_[static_cast<std::size_t>(pole)] = RoundHeight(sum / weights);
  }
}

RasterGrid::Cells RasterGrid::CellsAt(std::span<const Position> positions, std::size_t stride,
                                      std::span<const float> heights, int factor) const {
  Box hull{1e300, 1e300, -1e300, -1e300};
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const auto [x, y] = positions[i];
    if (std::isnan(x) || !std::isnan(heights[i])) continue;
    hull = {std::min(hull.west, x), std::min(hull.south, y), std::max(hull.east, x), std::max(hull.north, y)};
  }
  Cells found;
  if (hull.west > hull.east) return found;
  const InsideTest is_inside(cover_, cover_index_, hull);
  CellFinder finder(Columns(factor), Rows(factor), width_, height_, stride);
  found.cells.reserve(positions.size());
  found.nodes.reserve(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isnan(heights[i]) || !is_inside(positions[i])) continue;
    found.cells.push_back(finder.At(positions[i], i));
    found.nodes.push_back(i);
  }
  return found;
}

// Files are looked at even where nothing must be read: a tile of floor must not outlive its source. What lies between
// many sources depends on none of them.
Result<void> RasterGrid::CheckUnread() const {
  return members_.size() == 1 ? members_.front().raster->CheckUnchanged() : Result<void>();
}

GridWindow RasterGrid::Grown(const GridWindow& window, int halo, int factor) const {
  GridWindow wide{window.column - halo, window.row - halo, window.columns + std::int64_t{2} * halo,
                  window.rows + std::int64_t{2} * halo};
  const auto clip = [](std::int64_t& start, std::int64_t& length, std::int64_t count) {
    const std::int64_t end = std::min(start + length, count);
    start = std::max<std::int64_t>(start, 0);
    length = end - start;
  };
  if (!wraps_) clip(wide.column, wide.columns, Columns(factor).count());
  clip(wide.row, wide.rows, Rows(factor).count());
  return wide;
}

Result<RasterGrid::Bridged> RasterGrid::ReadBridged(int factor, const GridWindow& window, const std::stop_token& stop,
                                                    std::vector<float>* measured) const {
  auto core = ReadBlocks(factor, window, stop);
  if (!core) return tl::unexpected(core.error());
  if (measured != nullptr) *measured = *core;
  Bridged bridged{*std::move(core), 0};
  bridged.voids = static_cast<std::uint64_t>(std::ranges::count_if(bridged.heights, IsVoid));
  const int gap = options_.max_void_gap / factor;
  if (gap < 2 || bridged.voids == 0) return bridged;
  const GridWindow wide = Grown(window, gap, factor);
  const auto around = ReadBlocks(factor, wide, stop);
  if (!around) return tl::unexpected(around.error());
  if (!std::ranges::all_of(*around, IsVoid)) bridged.heights = FillVoids(*around, wide, window, gap);
  return bridged;
}

std::optional<float> RasterGrid::PoleHeight(int pole, HeightDatum datum) const {
  const std::optional<float>& height = pole_heights_[static_cast<std::size_t>(pole)];
  if (!height || !undulations_ || datum == HeightDatum::kSource) return height;
  const double undulation = undulations_->AtPole(pole);
  return std::isnan(undulation) ? std::nullopt : std::optional(RoundHeight(*height + undulation));
}

double RasterGrid::Feather(int factor) const {
  // Of the coarser axis: what is read around a tile, and the time that weights take, stay bounded.
  constexpr int kMaxSamples = 256;
  return std::min(options_.feather_m, kMaxSamples * factor * std::min(spacing_.east, spacing_.north));
}

Result<std::vector<float>> RasterGrid::ReadWeights(int factor, const GridWindow& window,
                                                   const std::stop_token& stop) const {
  const double feather = Feather(factor), column_step = spacing_.east * factor, row_step = spacing_.north * factor;
  const int halo = static_cast<int>(std::ceil(feather / std::min(column_step, row_step))) + 1;
  const GridWindow wide = Grown(window, halo, factor);
  const auto pixel = [factor](std::int64_t block) { return static_cast<double>(block * factor); };
  const bool ends = wide.rows < window.rows + 2 * halo || wide.columns < window.columns + 2 * halo;
  if (!ends &&
      !Ranges({pixel(wide.column), pixel(wide.row), pixel(wide.column + wide.columns), pixel(wide.row + wide.rows)})
           .has_voids) {
    return std::vector<float>();
  }
  const auto bridged = ReadBridged(factor, wide, stop);
  if (!bridged) return tl::unexpected(bridged.error());
  return FeatherWeights(bridged->heights, wide, window, column_step, row_step, feather);
}

Result<void> RasterGrid::FillAt(std::span<const Position> positions, std::size_t stride,
                                std::span<const double> undulations, int factor, const NodeHeights& nodes,
                                const std::stop_token& stop, GridTrace* trace) const {
  const auto [heights, weights, smooth] = nodes;
  Cells found = CellsAt(positions, stride, heights, factor), others;
  if (trace != nullptr && !weights.empty()) {
    std::vector<float> known(heights.size(), 0);
    for (std::size_t i = 0; i < known.size(); ++i) known[i] = std::isnan(heights[i]) ? 0 : SampleRules::kVoid;
    others = CellsAt(positions, stride, known, factor);
  }
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading was stopped");
  if (found.cells.empty()) return CheckUnread();
  GridWindow window = WindowOf(found.cells, Columns(factor), Rows(factor));
  // Samples between the outermost nodes and the rim are wanted too.
  constexpr int kRim = 3;
  if (trace != nullptr) window = Grown(window, kRim, factor);
  const auto bridged = ReadBridged(factor, window, stop, trace != nullptr ? &trace->samples : nullptr);
  if (!bridged) return tl::unexpected(bridged.error());
  const auto smoothed = FillHoles(factor, window, *bridged, stop);
  if (!smoothed) return tl::unexpected(smoothed.error());
  const bool has_holes = !smoothed->empty();
  const std::vector<float>& samples = has_holes ? *smoothed : bridged->heights;
  const auto left = static_cast<std::uint64_t>(bridged->voids == 0 ? 0 : std::ranges::count_if(samples, IsVoid));
  counts_->measured += samples.size() - bridged->voids;
  counts_->filled += bridged->voids - left;
  counts_->voids += left;
  if (trace != nullptr && !weights.empty() && factor == 1) {
    trace->samples = bridged->heights;
    trace->includes_filled = true;
  }
  std::vector<float> counts;
  if (!weights.empty() && options_.feather_m > 0) {
    auto read = ReadWeights(factor, window, stop);
    if (!read) return tl::unexpected(read.error());
    counts = *std::move(read);
    if (trace != nullptr && trace->includes_filled) trace->weights = counts;
  }
  for (std::size_t i = 0; i < found.cells.size(); ++i) {
    const std::size_t node = found.nodes[i];
    const auto height = Interpolate(samples, window, found.cells[i]);
    // Where the geoid is not known a height means nothing.
    if (!height || (!undulations.empty() && std::isnan(undulations[node]))) continue;
    const float rounded = RoundHeight(undulations.empty() ? *height : *height + undulations[node]);
    if (has_holes &&
        !HasSample(bridged->heights, window, found.cells[i])) {  // in a hole: another raster grid may know better
      if (!smooth.empty() && std::isnan(smooth[node])) smooth[node] = rounded;
      continue;
    }
    heights[node] = rounded;
    if (trace != nullptr) {
      trace->cell_of_node[node] = static_cast<std::int32_t>(i);
      trace->heights[node] = heights[node];
    }
    if (weights.empty()) continue;
    // Every sample has a weight, so this is plain bilinear. What counts nothing would still hide the floor.
    constexpr double kLeast = 0x1p-10;
    const double weight = counts.empty() ? 1 : Interpolate(counts, window, found.cells[i]).value_or(1);
    weights[node] = static_cast<float>(std::max(kLeast, std::nearbyint(weight * 1024) / 1024));
  }
  if (trace != nullptr) {
    trace->window = window;
    trace->cells = std::move(found.cells);
    TraceOthers(others, bridged->heights, samples, undulations, *trace);
  }
  return {};
}

// Nodes whose height others gave, as far as what was read tells the raster grid's own.
void RasterGrid::TraceOthers(const Cells& others, const std::vector<float>& bridged, const std::vector<float>& filled,
                             std::span<const double> undulations, GridTrace& trace) const {
  const GridWindow& window = trace.window;
  const std::int64_t turn = wraps_ ? Columns(trace.factor).count() : 0;
  for (std::size_t i = 0; i < others.cells.size(); ++i) {
    GridCell cell = others.cells[i];
    const std::size_t node = others.nodes[i];
    if (cell.column < window.column) cell.column += turn;
    if (cell.column + 1 >= window.column + window.columns) cell.column -= turn;
    if (cell.column < window.column || cell.column + 1 >= window.column + window.columns || cell.row < window.row ||
        cell.row + 1 >= window.row + window.rows) {
      continue;
    }
    const auto height = Interpolate(filled, window, cell);
    if (!height || !HasSample(bridged, window, cell)) continue;
    if (!undulations.empty() && std::isnan(undulations[node])) continue;
    trace.cell_of_node[node] = static_cast<std::int32_t>(trace.cells.size());
    trace.heights[node] = RoundHeight(undulations.empty() ? *height : *height + undulations[node]);
    trace.cells.push_back(cell);
  }
}

std::vector<Position> RasterGrid::PositionsOf(const geo::Lattice& lattice, const NodeWindow& window, int factor) const {
  return NodePositions(georeference_, reach_, lattice, window, kGridPositionTolerance * factor);
}

Result<void> RasterGrid::Fill(const geo::Lattice& lattice, const NodeWindow& window, HeightDatum datum,
                              const NodeHeights& nodes, const std::stop_token& stop, GridTrace* trace) const {
  const int factor = AveragingFactor(SamplesPerCell(lattice, spacing_));
  auto positions = PositionsOf(lattice, window, factor);
  if (trace != nullptr) {
    trace->positions = positions;
    trace->cell_of_node.assign(positions.size(), -1);
    trace->heights.assign(positions.size(), SampleRules::kVoid);
    trace->factor = factor;
  }
  for (int row = 0; row < window.rows && georeference_.is_geographic_grid(); ++row) {
    const std::int64_t global = window.row + row;
    if (global > 0 && global < lattice.rows()) continue;
    // Where columns are meridians they meet in one value.
    const auto first = static_cast<std::size_t>(row) * static_cast<std::size_t>(window.columns);
    std::fill_n(positions.begin() + static_cast<std::ptrdiff_t>(first), window.columns, kNowhere);
    if (const auto pole = PoleHeight(global <= 0 ? 0 : 1, datum)) {
      std::ranges::replace_if(
          nodes.heights.subspan(first, static_cast<std::size_t>(window.columns)),
          [](float height) { return std::isnan(height); }, *pole);
    }
  }
  std::vector<double> undulations;
  if (undulations_ && datum == HeightDatum::kEllipsoid) {
    auto found = undulations_->At(lattice, window);
    if (!found) return tl::unexpected(found.error());
    undulations = *std::move(found);
  }
  if (trace != nullptr) trace->undulations = undulations;
  return FillAt(positions, static_cast<std::size_t>(window.columns), undulations, factor, nodes, stop, trace);
}

Result<void> RasterGrid::Fill(const geo::MercatorGrid& grid, const NodeWindow& window, const NodeHeights& nodes,
                              const std::stop_token& stop) const {
  const int factor = MercatorFactor(grid.depth, spacing_);
  std::vector<double> undulations;
  if (undulations_) {
    auto found = undulations_->At(grid, window);
    if (!found) return tl::unexpected(found.error());
    undulations = *std::move(found);
  }
  return FillAt(NodePositions(georeference_, reach_, grid, window, kGridPositionTolerance * factor),
                static_cast<std::size_t>(window.columns), undulations, factor, nodes, stop);
}

}  // namespace terrace::dem

// Computes the heights of a window of nodes: positions, window of samples, voids, interpolation. Every step depends
// only on the global node, the level and the raster grid. The window of nodes determines what is read, but not the
// results.
#include "engine/mosaic/raster_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "engine/crs/node_positions.h"
#include "engine/mosaic/feather_weights.h"
#include "engine/mosaic/void_fill.h"
#include "engine/mosaic/window_values.h"
#include "engine/raster/grid_cells.h"
#include "engine/raster/nan_heights.h"
#include "engine/raster/node_rows.h"

namespace terrace::dem {
namespace {

// The error of interpolated positions, in samples of the grid that is read: 0.3 mm of height on a slope of 45 degrees
// at 30 m.
constexpr double kGridPositionTolerance = 1e-5;

Result<Georeference> GeoreferenceOf(const GridPlan& plan) {
  if (plan.members.size() == 1) return plan.members.front().raster->georeference();
  // The georeference of a member in the corner is used unchanged.
  const auto corner =
      std::ranges::find_if(plan.members, [](const GridMember& m) { return m.column == 0 && m.row == 0; });
  const GridMember& member = corner != plan.members.end() ? *corner : plan.members.front();
  return member.raster->georeference().Moved({-member.column, -member.row}, plan.width, plan.height,
                                             member.raster->info().path);
}

bool IsVoid(float height) { return std::isnan(height); }

int FactorOf(const geo::NodeGrid& grid, const SourceSpacing& spacing) {
  return grid.lattice() ? AveragingFactor(SamplesPerCell(*grid.lattice(), spacing))
                        : MercatorFactor(grid.mercator()->depth, spacing);
}

void TraceWanted(std::span<const float> heights, std::span<const std::uint8_t> wanted, bool are_all,
                 GridReading& reading) {
  if (are_all) {
    reading.heights.assign(heights.begin(), heights.end());
    return;
  }
  reading.heights.resize(wanted.size());
  float* const reading_of_part = reading.heights.data();
  for (std::size_t n = 0; n < wanted.size(); ++n) {
    const float height = heights[n];  // read for every node, or the compiler makes no vectors
    reading_of_part[n] = wanted[n] != 0 ? height : SampleRules::kVoid;
  }
}

// The smallest window with all voids of a window.
GridWindow HullOfVoids(const std::vector<float>& heights, const GridWindow& window) {
  using Ends = std::optional<std::pair<std::int64_t, std::int64_t>>;
  return HullOf(window, [&](std::int64_t row) -> Ends {
    const std::span<const float> of_row = std::span(heights).subspan(static_cast<std::size_t>(row * window.columns),
                                                                     static_cast<std::size_t>(window.columns));
    if (!HasVoids(of_row)) return std::nullopt;
    const auto first = std::ranges::find_if(of_row, IsVoid) - of_row.begin();
    std::int64_t last = window.columns - 1;
    while (!IsVoid(of_row[static_cast<std::size_t>(last)])) --last;
    return std::pair(first, last);
  });
}

// Whether all samples are equal, as on the sea: then the heights between them are, too. Zero with a sign may lose it.
bool IsOneHeight(const std::vector<float>& samples) {
  const float first = samples.front();
  return !std::isnan(first) && !std::signbit(first) &&
         std::memcmp(samples.data(), samples.data() + 1, (samples.size() - 1) * sizeof(float)) == 0;
}

// Interpolates whole rows at a time, for requested nodes that have valid samples around them.
void FillRows(const std::vector<float>& samples, const GridWindow& window, const NodeCells& cells,
              std::span<const std::uint8_t> wanted, bool are_all, std::span<const double> undulations,
              std::span<float> heights) {
  const std::size_t stride = cells.positions().columns(), rows = cells.positions().rows();
  std::vector<std::uint8_t> of_column(stride, are_all ? 1 : 0);
  for (std::size_t n = 0; n < wanted.size() && !are_all; n += stride) {
    for (std::size_t i = 0; i < stride; ++i) of_column[i] |= wanted[n + i];
  }
  const auto first = static_cast<std::size_t>(std::ranges::find(of_column, std::uint8_t{1}) - of_column.begin());
  std::size_t end = stride;
  while (of_column[end - 1] == 0) --end;
  NodeRows lines(samples, window, cells, first, end);
  std::vector<float> rounded(end - first);
  for (std::size_t j = 0; j < rows; ++j) {
    const std::size_t of_row = j * stride + first;
    const auto row = wanted.subspan(of_row, rounded.size());
    if (!are_all && std::ranges::find(row, std::uint8_t{1}) == row.end()) continue;
    RoundHeights(lines.Row(j), undulations.empty() ? undulations : undulations.subspan(of_row, rounded.size()),
                 rounded);
    if (are_all || std::memchr(row.data(), 0, row.size()) == nullptr) {
      std::ranges::copy(rounded, heights.begin() + static_cast<std::ptrdiff_t>(of_row));
    } else {
      for (std::size_t i = 0; i < row.size(); ++i) {
        float& height = heights[of_row + i];
        height = row[i] != 0 ? rounded[i] : height;
      }
    }
    const bool has_voids = HasVoids(rounded);
    for (std::size_t i = 0; has_voids && i < row.size(); ++i) {
      if (row[i] == 0 || !IsVoid(rounded[i])) continue;
      if (!undulations.empty() && std::isnan(undulations[of_row + i])) continue;
      const auto height = Interpolate(samples, window, cells.At(first + i, j));  // without the voids
      if (!height) continue;
      heights[of_row + i] = RoundHeight(undulations.empty() ? *height : *height + undulations[of_row + i]);
    }
  }
}

}  // namespace

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
  // There may be no position on Earth half way between distant members.
  grid.spacing_ = SourceSpacing::Of(grid.georeference_, first.info().path).value_or(first.spacing());
  grid.reach_ = Footprint::Of(grid.georeference_).Padded();
  grid.IndexMembers();
  grid.MeasureMembers();
  grid.FindPoleHeights();
  if (options.holes == HoleFill::kSmooth) {
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
  heights_ = {std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  std::vector<BoxIndex::Entry> entries;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const GridMember& member = members_[i];
    if (member.raster->has_heights()) {
      const HeightRange& heights = member.raster->info().heights;
      heights_ = {std::min(heights_.min, heights.min), std::max(heights_.max, heights.max)};
    }
    while (member.column % alignment_ != 0 || member.row % alignment_ != 0 || (turn > 0 && turn % alignment_ != 0)) {
      alignment_ /= 2;
    }
    const Box box = BoxOf(member.pixels());
    for (const std::int64_t shift : {std::int64_t{0}, -turn, turn}) {
      const auto x = static_cast<double>(shift);
      entries.push_back({{box.min_x + x, box.min_y, box.max_x + x, box.max_y}, i});
      if (turn == 0) break;
    }
  }
  member_index_ = BoxIndex(entries);
  cover_ = GridCover(members_, turn);
}

// Rasters that lie slightly off a grid are read as if they were on it; the error bounds account for the offset.
void RasterGrid::MeasureMembers() {
  // 360 degrees count as a whole number of columns. The surface of a raster grid around the Earth jumps by the rest
  // where it closes, and further columns are off by the rest.
  const double seam = wraps_ ? 2 * std::abs(georeference_.period() - columns_) : 0;
  for (GridMember& member : members_) {
    if (members_.size() > 1) {
      member.misplacement =
          georeference_.LargestMisplacement(member.raster->georeference(), {member.column, member.row});
    }
    member.misplacement.x += seam;
  }
}

// The mean of the members' rows at a pole, weighted by width.
void RasterGrid::FindPoleHeights() {
  if (!georeference_.is_geographic_grid()) return;
  for (const int pole : {0, 1}) {
    Position position{0, pole == 0 ? -90.0 : 90.0};
    georeference_.ToPixels({&position, 1});
    if (!(position.y >= -GridCover::kEdgeTolerance && position.y <= height_ + GridCover::kEdgeTolerance)) continue;
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

// Checks the files even if nothing is read, so that a tile of floor does not outlive its source. Tiles between many
// sources depend on none of them.
Result<void> RasterGrid::CheckUnchanged() const {
  return members_.size() == 1 ? members_.front().raster->CheckUnchanged() : Result<void>();
}

// The same for a window of voids, of all members that it overlaps.
Result<void> RasterGrid::CheckMembersUnchanged(int factor, const GridWindow& window) const {
  for (const std::size_t i : MembersAt(PixelsOf(window, factor))) {
    if (auto unchanged = members_[i].raster->CheckUnchanged(); !unchanged) return unchanged;
  }
  return {};
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

bool RasterGrid::IsUnfilledVoid(int factor, const GridWindow& window) const {
  // Narrow voids are filled from samples around them. Averages by overviews reach up to three averages into a void
  // (cubic splines, each overview made from the one before), and heights are interpolated between averages.
  const GridWindow around = Grown(window, options_.max_void_gap / factor + 6, factor);
  const BlockRange range = Ranges(PixelsOf(around, factor));
  if (range.min <= range.max) return false;
  if (options_.holes != HoleFill::kSmooth) return true;
  // All of the window is one void, so that any average tells whether it is a hole.
  const GridWindow first{window.column, window.row, 1, 1};
  return voids_.HolesIn(members_, member_index_, factor, first, Columns(factor).count(), NaNHeights(1)).front() == 0;
}

Result<RasterGrid::Bridged> RasterGrid::ReadBridged(int factor, const GridWindow& window, const std::stop_token& stop,
                                                    std::vector<float>* measured) const {
  auto core = ReadAverages(factor, window, stop);
  if (!core) return tl::unexpected(core.error());
  Bridged bridged{*std::move(core), 0};
  bridged.voids = CountVoids(bridged.heights);
  if (measured != nullptr && bridged.voids > 0) *measured = bridged.heights;
  const int gap = options_.max_void_gap / factor;
  if (gap < 2 || bridged.voids == 0) return bridged;
  const GridWindow voids = HullOfVoids(bridged.heights, window), wide = Grown(voids, gap, factor);
  const auto around = ReadWithKnown(factor, wide, window, bridged.heights, stop);
  if (!around) return tl::unexpected(around.error());
  if (std::ranges::all_of(*around, IsVoid)) return bridged;
  std::vector<float> filled = FillVoids(*around, wide, voids, gap);
  cover_.RemoveUncovered(factor, wraps_ ? Columns(factor).count() : 0, voids, filled);
  CopyInto(filled, voids, window, bridged.heights);
  return bridged;
}

Result<std::vector<float>> RasterGrid::ReadWithKnown(int factor, const GridWindow& wide, const GridWindow& core,
                                                     const std::vector<float>& known,
                                                     const std::stop_token& stop) const {
  std::vector<float> all(static_cast<std::size_t>(wide.columns * wide.rows));
  const std::int64_t west = std::max(wide.column, core.column), north = std::max(wide.row, core.row);
  const std::int64_t east = std::min(wide.column + wide.columns, core.column + core.columns);
  const std::int64_t south = std::min(wide.row + wide.rows, core.row + core.rows);
  for (std::int64_t row = north; row < south; ++row) {
    const auto from = known.begin() + static_cast<std::ptrdiff_t>(IndexIn(core, west, row));
    std::copy_n(from, east - west, all.begin() + static_cast<std::ptrdiff_t>(IndexIn(wide, west, row)));
  }
  const std::int64_t wide_east = wide.column + wide.columns, wide_south = wide.row + wide.rows;
  for (const GridWindow& rest : {GridWindow{wide.column, wide.row, wide.columns, north - wide.row},
                                 GridWindow{wide.column, south, wide.columns, wide_south - south},
                                 GridWindow{wide.column, north, west - wide.column, south - north},
                                 GridWindow{east, north, wide_east - east, south - north}}) {
    if (rest.columns == 0 || rest.rows == 0) continue;
    const auto read = ReadAverages(factor, rest, stop);
    if (!read) return read;
    CopyInto(*read, rest, wide, all);
  }
  return all;
}

std::optional<float> RasterGrid::PoleHeight(int pole, HeightDatum datum) const {
  const std::optional<float>& height = pole_heights_[static_cast<std::size_t>(pole)];
  if (!height || !undulations_ || datum == HeightDatum::kSource) return height;
  const double undulation = undulations_->AtPole(pole);
  return std::isnan(undulation) ? std::nullopt : std::optional(RoundHeight(*height + undulation));
}

double RasterGrid::Feather(int factor) const {
  // Counted on the finer axis. Limits the samples read around a tile, and the time for weights.
  constexpr int kMaxSamples = 256;
  return std::min(options_.feather_m, kMaxSamples * factor * std::min(spacing_.east, spacing_.north));
}

Result<std::vector<float>> RasterGrid::ReadWeights(int factor, const GridWindow& window,
                                                   const std::stop_token& stop) const {
  const double feather = Feather(factor), column_step = spacing_.east * factor, row_step = spacing_.north * factor;
  const int halo = static_cast<int>(std::ceil(feather / std::min(column_step, row_step))) + 1;
  const GridWindow wide = Grown(window, halo, factor);
  const bool ends = wide.rows < window.rows + 2 * halo || wide.columns < window.columns + 2 * halo;
  if (!ends && !Ranges(PixelsOf(wide, factor)).has_voids) return std::vector<float>();
  const auto bridged = ReadBridged(factor, wide, stop);
  if (!bridged) return tl::unexpected(bridged.error());
  return FeatherWeights(bridged->heights, wide, window, column_step, row_step, feather);
}

Result<void> RasterGrid::FillNodesAt(NodePositions positions, std::span<const std::uint8_t> inside,
                                     std::span<const double> undulations, int factor, const NodeHeights& nodes,
                                     const std::stop_token& stop, GridReading* reading) const {
  const std::span<float> heights = nodes.heights, weights = nodes.weights;
  const bool traces_others = reading != nullptr && !weights.empty();
  std::vector<std::uint8_t> wanted;
  bool is_any_wanted = true;
  if (nodes.are_void) {
    wanted.assign(inside.begin(), inside.end());
    is_any_wanted = std::memchr(wanted.data(), 1, wanted.size()) != nullptr;
  } else {
    wanted.resize(inside.size());
    is_any_wanted = WantVoids(inside, heights, wanted);
  }
  const bool are_all = std::memchr(wanted.data(), 0, wanted.size()) == nullptr;
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading was stopped");
  NodeCells cells(std::move(positions), Axes(factor));
  const auto leave_unfilled = [&](const Result<void>& unchanged) {
    if (reading != nullptr) {
      reading->heights = NaNHeights(inside.size());
      reading->cells = std::move(cells);
    }
    return unchanged;
  };
  if (!is_any_wanted) return leave_unfilled(CheckUnchanged());
  GridWindow window = cells.MoveIntoWindow(wanted, are_all);
  if (IsUnfilledVoid(factor, window)) {
    counts_->voids += static_cast<std::uint64_t>(window.columns * window.rows);
    return leave_unfilled(CheckMembersUnchanged(factor, window));
  }
  // At the rim of a raster, the certified error compares averages between the outermost nodes and the rim, too
  // (CellErrorBound). Where they are missing, it is looser.
  constexpr int kRim = 3;
  if (reading != nullptr) window = Grown(window, kRim, factor);
  auto bridged = ReadBridged(factor, window, stop, reading != nullptr ? &reading->samples : nullptr);
  if (!bridged) return tl::unexpected(bridged.error());
  const auto smoothed = FillHoles(factor, window, *bridged, stop);
  if (!smoothed) return tl::unexpected(smoothed.error());
  const bool has_holes = !smoothed->empty();
  const std::vector<float>& samples = has_holes ? *smoothed : bridged->heights;
  const auto left = static_cast<std::uint64_t>(bridged->voids == 0 ? 0 : CountVoids(samples));
  counts_->measured += samples.size() - bridged->voids;
  counts_->filled += bridged->voids - left;
  counts_->voids += left;
  if (traces_others && factor == 1) {
    if (bridged->voids > 0) reading->samples = bridged->heights;
    reading->includes_filled = true;
  }
  std::vector<float> sample_weights;
  if (!weights.empty() && options_.feather_m > 0) {
    auto read = ReadWeights(factor, window, stop);
    if (!read) return tl::unexpected(read.error());
    sample_weights = *std::move(read);
    if (reading != nullptr && reading->includes_filled) reading->weights = sample_weights;
  }
  const auto take = [&](std::size_t node, const GridCell& cell) {
    const auto height = Interpolate(samples, window, cell);
    // Without the geoid a height has no meaning.
    if (!height || (!undulations.empty() && std::isnan(undulations[node]))) return;
    const float rounded = RoundHeight(undulations.empty() ? *height : *height + undulations[node]);
    if (has_holes && !HasSample(bridged->heights, window, cell)) {  // in a hole: another raster grid may have a height
      if (nodes.hole_heights == nullptr) return;
      if (nodes.hole_heights->empty()) *nodes.hole_heights = NaNHeights(heights.size());
      if (float& height_there = (*nodes.hole_heights)[node]; std::isnan(height_there)) height_there = rounded;
      return;
    }
    heights[node] = rounded;
    if (reading != nullptr) reading->heights[node] = rounded;
    if (weights.empty()) return;
    // All samples have weights, so this is plain bilinear interpolation. The least weight is above 0,
    // so that a node that no other grid has a height for takes the height of this one.
    constexpr double kMinWeight = 0x1p-10;
    const double weight = sample_weights.empty() ? 1 : Interpolate(sample_weights, window, cell).value_or(1);
    weights[node] = static_cast<float>(std::max(kMinWeight, std::nearbyint(weight * 1024) / 1024));
  };
  if (!has_holes && weights.empty()) {
    if (are_all && undulations.empty() && IsOneHeight(samples)) {
      FillWith(RoundHeight(samples.front()), heights);
    } else if (left < samples.size()) {
      FillRows(samples, window, cells, wanted, are_all, undulations, heights);
    }
    if (reading != nullptr) TraceWanted(heights, wanted, are_all, *reading);
  } else {
    if (reading != nullptr) reading->heights = NaNHeights(inside.size());
    const auto stride = static_cast<std::size_t>(cells.window().columns);
    std::size_t node = 0;
    for (std::size_t j = 0; node < wanted.size(); ++j) {
      for (std::size_t i = 0; i < stride; ++i, ++node) {
        if (wanted[node] != 0) take(node, cells.At(i, j));
      }
    }
  }
  if (reading == nullptr) return {};
  reading->window = window;
  reading->cells = std::move(cells);
  if (traces_others) {
    std::vector<std::uint8_t> others(inside.size());
    for (std::size_t n = 0; n < others.size(); ++n) others[n] = inside[n] & (wanted[n] ^ std::uint8_t{1});
    AddReadingsOfOthers(others, bridged->heights, samples, undulations, *reading);
  }
  if (bridged->voids == 0) reading->samples = std::move(bridged->heights);  // not copied: nothing was filled
  return {};
}

// Traces nodes whose heights came from other raster grids, as far as this raster grid's samples were read.
void RasterGrid::AddReadingsOfOthers(std::span<const std::uint8_t> others, const std::vector<float>& bridged,
                                     const std::vector<float>& filled, std::span<const double> undulations,
                                     GridReading& reading) const {
  const GridWindow& window = reading.window;
  const auto stride = static_cast<std::size_t>(reading.cells.window().columns);
  for (std::size_t node = 0; node < others.size(); ++node) {
    if (others[node] == 0) continue;
    const GridCell cell = reading.cells.At(node % stride, node / stride);
    if (cell.column < window.column || cell.column + 1 >= window.column + window.columns || cell.row < window.row ||
        cell.row + 1 >= window.row + window.rows) {
      continue;
    }
    const auto height = Interpolate(filled, window, cell);
    if (!height || !HasSample(bridged, window, cell)) continue;
    if (!undulations.empty() && std::isnan(undulations[node])) continue;
    reading.heights[node] = RoundHeight(undulations.empty() ? *height : *height + undulations[node]);
  }
}

NodeCells RasterGrid::CellsOf(const geo::Lattice& lattice, const NodeWindow& window, int factor,
                              const GridWindow& samples) const {
  NodeCells cells(PositionsOf(lattice, window, factor), Axes(factor));
  cells.MoveNear(samples.column + samples.columns / 2);
  return cells;
}

NodePositions RasterGrid::PositionsOf(const geo::NodeGrid& node_grid, const NodeWindow& window, int factor) const {
  return NodePositions::Of(georeference_, reach_, node_grid, window, kGridPositionTolerance * factor);
}

Result<void> RasterGrid::FillNodes(const geo::NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                                   const NodeHeights& nodes, const std::stop_token& stop, GridReading* reading) const {
  const int factor = FactorOf(node_grid, spacing_);
  NodePositions positions = PositionsOf(node_grid, window, factor);
  std::vector<std::uint8_t> inside = cover_.Inside(positions);
  if (reading != nullptr) reading->factor = factor;
  for (int row = 0; row < window.rows && georeference_.is_geographic_grid(); ++row) {
    const std::int64_t global = window.row + row;
    if (!node_grid.IsPoleRow(global)) continue;
    // If columns are meridians, all nodes of a pole have one value.
    const auto first = static_cast<std::size_t>(row) * positions.columns();
    std::fill_n(inside.begin() + static_cast<std::ptrdiff_t>(first), window.columns, std::uint8_t{0});
    if (const auto pole = PoleHeight(global <= 0 ? 0 : 1, datum)) {
      ReplaceVoids(nodes.heights.subspan(first, positions.columns()), *pole);
    }
  }
  std::vector<double> undulations;
  if (undulations_ && datum == HeightDatum::kEllipsoid) {
    auto found = undulations_->At(node_grid, window);
    if (!found) return tl::unexpected(found.error());
    undulations = *std::move(found);
  }
  if (reading != nullptr) reading->undulations = undulations;
  return FillNodesAt(std::move(positions), inside, undulations, factor, nodes, stop, reading);
}

}  // namespace terrace::dem

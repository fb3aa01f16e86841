// From a window of nodes to heights: positions, window, voids, interpolation. Every step is a function of the global
// node, the level and the sheet; the window decides only what is read, never what comes out.
#include "engine/dem/sheet.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/dem/grid_cells.h"
#include "engine/dem/node_positions.h"
#include "engine/dem/void_fill.h"

namespace terrace::dem {
namespace {

// Interpolated positions are this close to exact ones, in samples of the grid they are read from: a slope of 45 degrees
// at 30 m turns it into 0.3 mm.
constexpr double kPositionTolerance = 1e-5;
// Positions this close to the raster's edge, in pixels, are on it.
constexpr double kEdgeTolerance = 1e-6;

GridWindow Grown(const GridWindow& window, int halo, const GridAxis& columns, const GridAxis& rows) {
  GridWindow wide{window.column - halo, window.row - halo, window.columns + std::int64_t{2} * halo,
                  window.rows + std::int64_t{2} * halo};
  const auto clip = [](std::int64_t& start, std::int64_t& length, std::int64_t count) {
    const std::int64_t end = std::min(start + length, count);
    start = std::max<std::int64_t>(start, 0);
    length = end - start;
  };
  if (!columns.wraps()) clip(wide.column, wide.columns, columns.count());
  clip(wide.row, wide.rows, rows.count());
  return wide;
}

// Heights at the poles of a geographic raster whose first or last row holds them.
std::array<std::optional<float>, 2> PoleHeights(const RasterSource& raster) {
  std::array<std::optional<float>, 2> heights;
  const Georeference& georeference = raster.georeference();
  if (!georeference.is_geographic_grid()) return heights;
  for (const int pole : {0, 1}) {
    Position position{0, pole == 0 ? -90.0 : 90.0};
    georeference.ToPixels({&position, 1});
    if (!(position.y >= -kEdgeTolerance && position.y <= georeference.height() + kEdgeTolerance)) continue;
    const auto& mean = raster.edge_row_means()[position.y < georeference.height() / 2.0 ? 0 : 1];
    if (mean) heights[static_cast<std::size_t>(pole)] = RoundHeight(*mean);
  }
  return heights;
}

}  // namespace

float RoundHeight(double metres) { return static_cast<float>(std::nearbyint(metres * 1024) / 1024); }

Sheet::Sheet(std::shared_ptr<const RasterSource> raster, int max_void_gap)
    : raster_(std::move(raster)),
      footprint_(raster_->footprint().Padded()),
      max_void_gap_(max_void_gap),
      pole_heights_(PoleHeights(*raster_)) {}

bool Sheet::IsInside(const Position& position) const {
  const RasterLayout& layout = raster_->layout();
  const bool row = position.y >= -kEdgeTolerance && position.y <= layout.height + kEdgeTolerance;
  return row && (layout.wraps || (position.x >= -kEdgeTolerance && position.x <= layout.width + kEdgeTolerance));
}

std::optional<float> Sheet::PoleHeight(const geo::Lattice& lattice, std::int64_t row) const {
  return row > 0 && row < lattice.rows() ? std::nullopt : pole_heights_[row <= 0 ? 0 : 1];
}

Result<std::vector<float>> Sheet::ReadFilled(int factor, const GridWindow& window, const std::stop_token& stop,
                                             SheetTrace* trace) const {
  const auto is_void = [](float height) { return std::isnan(height); };
  const RasterLayout& layout = raster_->layout();
  auto core = raster_->ReadBlocks(factor, window, stop);
  if (core && trace != nullptr) trace->samples = *core;
  const int gap = max_void_gap_ / factor;
  if (!core || gap < 2 || std::ranges::none_of(*core, is_void)) return core;
  const GridWindow wide =
      Grown(window, gap, GridAxis(layout.columns, factor, layout.wraps), GridAxis(layout.height, factor, false));
  auto around = raster_->ReadBlocks(factor, wide, stop);
  if (!around || std::ranges::all_of(*around, is_void)) return core;
  return FillVoids(*around, wide, window, gap);
}

Result<void> Sheet::FillAt(std::span<const Position> positions, int factor, std::span<float> heights,
                           const std::stop_token& stop, SheetTrace* trace) const {
  const RasterLayout& layout = raster_->layout();
  const GridAxis columns(layout.columns, factor, layout.wraps), rows(layout.height, factor, false);
  std::vector<GridCell> cells;
  std::vector<std::size_t> nodes;  // node of each cell
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isnan(heights[i]) || !IsInside(positions[i])) continue;
    cells.push_back(CellAt(positions[i], columns, rows, layout.width, layout.height));
    nodes.push_back(i);
  }
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "was stopped");
  // Files are looked at even where nothing must be read: a tile of floor must not outlive its source.
  if (cells.empty()) return raster_->CheckUnchanged();
  GridWindow window = WindowOf(cells, columns, rows);
  // Samples between the outermost nodes and the rim are wanted too.
  constexpr int kRim = 3;
  if (trace != nullptr) window = Grown(window, kRim, columns, rows);
  const auto samples = ReadFilled(factor, window, stop, trace);
  if (!samples) return tl::unexpected(samples.error());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto height = Interpolate(*samples, window, cells[i]);
    if (!height) continue;
    heights[nodes[i]] = RoundHeight(*height);
    if (trace != nullptr) trace->cell_of_node[nodes[i]] = static_cast<std::int32_t>(i);
  }
  if (trace != nullptr) {
    trace->window = window;
    trace->cells = std::move(cells);
  }
  return {};
}

Result<void> Sheet::Fill(const geo::Lattice& lattice, const NodeWindow& window, std::span<float> heights,
                         const std::stop_token& stop, SheetTrace* trace) const {
  const int factor = AveragingFactor(SamplesPerCell(lattice, spacing()));
  auto positions = NodePositions(raster_->georeference(), footprint_, lattice, window, kPositionTolerance * factor);
  if (trace != nullptr) {
    trace->positions = positions;
    trace->cell_of_node.assign(positions.size(), -1);
    trace->factor = factor;
  }
  if (raster_->georeference().is_geographic_grid()) {
    for (int row = 0; row < window.rows; ++row) {
      const std::int64_t global = window.row + row;
      if (global > 0 && global < lattice.rows()) continue;
      const auto first = std::ptrdiff_t{row} * window.columns;
      std::fill_n(positions.begin() + first, window.columns, kNowhere);
      if (const auto pole = PoleHeight(lattice, global)) {
        std::ranges::replace_if(
            heights.subspan(static_cast<std::size_t>(first), static_cast<std::size_t>(window.columns)),
            [](float height) { return std::isnan(height); }, *pole);
      }
    }
  }
  return FillAt(positions, factor, heights, stop, trace);
}

Result<void> Sheet::Fill(const geo::MercatorGrid& grid, const NodeWindow& window, std::span<float> heights,
                         const std::stop_token& stop) const {
  const int factor = MercatorFactor(grid.depth, spacing());
  return FillAt(NodePositions(raster_->georeference(), footprint_, grid, window, kPositionTolerance * factor), factor,
                heights, stop, nullptr);
}

}  // namespace terrace::dem

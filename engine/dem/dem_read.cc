// From a tile key to heights: positions, window, voids, interpolation. Every step is a function of the global node, the
// level and the source; the window decides only what is read, never what comes out.
#include <algorithm>
#include <cmath>

#include "engine/core/check.h"
#include "engine/dem/dem_impl.h"
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

}  // namespace

float RoundHeight(double metres) { return static_cast<float>(std::nearbyint(metres * 1024) / 1024); }

const LevelPlan& DemSource::Impl::Plan(int level) const {
  TERRACE_CHECK(level >= 0 && level < static_cast<int>(levels.size()));
  return levels[static_cast<std::size_t>(level)];
}

bool DemSource::Impl::IsInside(const Position& position) const {
  const bool row = position.y >= -kEdgeTolerance && position.y <= layout.height + kEdgeTolerance;
  return row && (layout.wraps || (position.x >= -kEdgeTolerance && position.x <= layout.width + kEdgeTolerance));
}

std::optional<float> DemSource::Impl::PoleHeight(const geo::Lattice& lattice, std::int64_t row) const {
  if (!georeference.is_geographic_grid() || (row > 0 && row < lattice.rows())) return std::nullopt;
  return pole_heights[row <= 0 ? 0 : 1].value_or(floor);
}

Result<std::vector<float>> DemSource::Impl::ReadFilled(GDALDataset& dataset, int factor, const GridWindow& window,
                                                       const std::stop_token& stop) {
  const auto is_void = [](float height) { return std::isnan(height); };
  auto core = ReadGrid(dataset, layout, factor, window, stop);
  const int gap = max_void_gap / factor;
  if (!core || gap < 2 || std::ranges::none_of(*core, is_void)) return core;
  const GridWindow wide =
      Grown(window, gap, GridAxis(layout.columns, factor, layout.wraps), GridAxis(layout.height, factor, false));
  auto around = ReadGrid(dataset, layout, factor, wide, stop);
  if (!around || std::ranges::all_of(*around, is_void)) return core;
  return FillVoids(*around, wide, window, gap);
}

// Heights under the rules of tiles: averaged by the factor, small voids filled, the floor elsewhere.
Result<std::vector<float>> DemSource::Impl::ReadFloored(std::span<const Position> positions, int factor,
                                                        const std::string& what, const std::stop_token& stop) {
  std::vector<float> out(positions.size(), floor);
  const GridAxis columns(layout.columns, factor, layout.wraps), rows(layout.height, factor, false);
  std::vector<GridCell> cells;
  std::vector<std::size_t> nodes;  // node of each cell
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!IsInside(positions[i])) continue;
    cells.push_back(CellAt(positions[i], columns, rows, layout.width, layout.height));
    nodes.push_back(i);
  }
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: reading {} was stopped", info.path, what);
  // Files are looked at even where nothing must be read: a tile of floor must not outlive its source.
  auto handle = handles.Borrow();
  if (!handle) return tl::unexpected(handle.error());
  if (cells.empty()) return out;
  const GridWindow window = WindowOf(cells, columns, rows);
  const auto heights = ReadFilled(**handle, factor, window, stop);
  if (!heights) {
    return MakeError(heights.error().code, "{}: {}: {}", info.path, what, heights.error().message);
  }
  if (auto unchanged = handles.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (const auto height = Interpolate(*heights, window, cells[i])) out[nodes[i]] = RoundHeight(*height);
  }
  return out;
}

Result<std::vector<float>> DemSource::Impl::ReadNodes(int level, const NodeWindow& window, const std::string& what,
                                                      const std::stop_token& stop) {
  const auto& [lattice, factor] = Plan(level);
  const auto positions = NodePositions(georeference, footprint, lattice, window, kPositionTolerance * factor);
  auto heights = ReadFloored(positions, factor, what, stop);
  if (!heights) return heights;
  for (int row = 0; row < window.rows; ++row) {
    if (const auto pole = PoleHeight(lattice, window.row + row)) {
      std::fill_n(heights->begin() + std::ptrdiff_t{row} * window.columns, window.columns, *pole);
    }
  }
  return heights;
}

Result<TileHeights> DemSource::Impl::Read(const geo::TileKey& key, const std::stop_token& stop) {
  const geo::Lattice& lattice = Plan(key.level).lattice;
  auto heights = ReadNodes(key.level, WindowOfTile(lattice, key), "tile " + geo::ToString(key), stop);
  if (!heights) return tl::unexpected(std::move(heights).error());
  return TileHeights{lattice, lattice.cells + 3, *std::move(heights)};
}

Result<std::vector<float>> DemSource::Impl::ReadMercator(int depth, const NodeWindow& window,
                                                         const std::stop_token& stop) {
  const int factor = mercator_factors[static_cast<std::size_t>(depth)];
  const auto positions =
      NodePositions(georeference, footprint, geo::MercatorGrid{depth}, window, kPositionTolerance * factor);
  return ReadFloored(positions, factor, fmt::format("Mercator pixels of depth {}", depth), stop);
}

}  // namespace terrace::dem

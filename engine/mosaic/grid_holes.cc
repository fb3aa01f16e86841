// Smooth surfaces in the holes of a raster grid (docs/decisions/0015-voids.md). A height depends only on the factor and
// the global sample: windows are extended until they contain all that is needed of a hole.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "engine/mosaic/raster_grid.h"
#include "engine/mosaic/window_values.h"

namespace terrace::dem {
namespace {

// Those of `all`, the values of a grid, that lie in a window.
template <typename T>
std::vector<T> Cut(const WindowWithHoles& grid, const std::vector<T>& all, const GridWindow& window) {
  std::vector<T> values;
  values.reserve(static_cast<std::size_t>(window.columns * window.rows));
  for (std::int64_t row = window.row; row < window.row + window.rows; ++row) {
    const auto first = all.begin() + static_cast<std::ptrdiff_t>(grid.At(window.column, row));
    values.insert(values.end(), first, first + window.columns);
  }
  return values;
}

// The smallest window with all marked samples of a window; without columns if there are none.
GridWindow HullOfMarks(const std::vector<std::uint8_t>& marks, const GridWindow& window) {
  using Ends = std::optional<std::pair<std::int64_t, std::int64_t>>;
  return HullOf(window, [&](std::int64_t row) -> Ends {
    const auto columns = static_cast<std::size_t>(window.columns);
    const std::uint8_t* const of_row = marks.data() + row * window.columns;
    const auto* const first = static_cast<const std::uint8_t*>(std::memchr(of_row, 1, columns));
    if (first == nullptr) return std::nullopt;
    return std::pair(first - of_row, static_cast<const std::uint8_t*>(memrchr(of_row, 1, columns)) - of_row);
  });
}

// Averages beside a hole may cover only a part of their block, and so not its centre. The initial guess does not use
// them, so that it continues a plane exactly. They are used if nothing lies behind them.
void WidenHoles(const GridWindow& wide, const std::vector<float>& heights, const std::vector<std::uint8_t>& holes,
                std::int64_t columns, std::int64_t rows, bool wraps, WindowWithHoles& grid) {
  const WindowWithHoles around{wide, {}, {}};
  const GridWindow& window = grid.window;
  for (std::int64_t row = window.row; row < window.row + window.rows; ++row) {
    for (std::int64_t column = window.column; column < window.column + window.columns; ++column) {
      if (std::isnan(heights[around.At(column, row)])) continue;
      bool is_beside = false, is_last = row == 0 || row == rows - 1;
      if (!wraps) is_last |= column == 0 || column == columns - 1;
      for (std::int64_t y = row - 1; y <= row + 1 && !is_last; ++y) {
        for (std::int64_t x = column - 1; x <= column + 1; ++x) {
          const std::size_t at = around.At(x, y);
          is_beside |= holes[at] != 0;
          is_last |= std::isnan(heights[at]) && holes[at] == 0;
        }
      }
      if (is_beside && !is_last) grid.unknown[grid.At(column, row)] = 1;
    }
  }
}

}  // namespace

Result<WindowWithHoles> RasterGrid::ReadWithHoles(int factor, const GridWindow& window, bool is_guess,
                                                  const std::stop_token& stop) const {
  const auto holes_in = [&](const GridWindow& in, const std::vector<float>& heights) {
    return voids_.HolesIn(members_, member_index_, factor, in, Columns(factor).count(), heights);
  };
  if (!is_guess) {
    auto bridged = ReadBridged(factor, window, stop);
    if (!bridged) return tl::unexpected(bridged.error());
    auto holes = holes_in(window, bridged->heights);
    return WindowWithHoles{window, std::move(bridged->heights), std::move(holes)};
  }
  const GridWindow wide = Grown(window, 1, factor);
  const auto heights = ReadAverages(factor, wide, stop);
  if (!heights) return tl::unexpected(heights.error());
  const auto holes = holes_in(wide, *heights);
  const WindowWithHoles around{wide, {}, {}};
  WindowWithHoles grid{window, Cut(around, *heights, window), Cut(around, holes, window)};
  WidenHoles(wide, *heights, holes, Columns(factor).count(), Rows(factor).count(), wraps_, grid);
  return grid;
}

// Initial guess for large regions, from the same holes by twice the factor. The guess is then adjusted to the heights
// around.
Result<void> RasterGrid::GuessLarge(int factor, const GridWindow& window, const std::vector<VoidRegion>& regions,
                                    WindowWithHoles& grid, const std::stop_token& stop) const {
  const GridWindow near = Grown(window, kSweeps, factor);
  const GridAxis columns = Columns(factor), rows = Rows(factor);
  const GridAxis coarse_columns = Columns(2 * factor), coarse_rows = Rows(2 * factor);
  std::vector<std::size_t> samples;
  std::vector<GridCell> cells;
  for (const VoidRegion& region : regions) {
    if (!region.is_large()) continue;
    for (const std::size_t sample : region.samples) {
      const auto at = static_cast<std::int64_t>(sample);
      const std::int64_t column = grid.window.column + at % grid.window.columns;
      const std::int64_t row = grid.window.row + at / grid.window.columns;
      if (column < near.column || column >= near.column + near.columns || row < near.row ||
          row >= near.row + near.rows) {
        continue;
      }
      const GridAxis::Location x = coarse_columns.Locate(columns.Center(column)),
                               y = coarse_rows.Locate(rows.Center(row));
      samples.push_back(sample);
      cells.push_back({x.index, y.index, x.weight, y.weight});
    }
  }
  if (samples.empty()) return {};
  const GridWindow coarse = WindowOf(cells, Axes(2 * factor));
  const auto guess = ReadSmooth(2 * factor, coarse, true, stop);
  if (!guess) return tl::unexpected(guess.error());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto height = Interpolate(*guess, coarse, cells[i]);
    grid.heights[samples[i]] = height ? static_cast<float>(*height) : SampleRules::kVoid;
  }
  RelaxHarmonic(samples, grid);
  return {};
}

Result<std::vector<float>> RasterGrid::ReadSmooth(int factor, const GridWindow& window, bool is_guess,
                                                  const std::stop_token& stop) const {
  for (int halo = kSweeps + 1;; halo *= 2) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading was stopped");
    const GridWindow wide = Grown(window, halo, factor);
    auto grid = ReadWithHoles(factor, wide, is_guess, stop);
    if (!grid) return tl::unexpected(grid.error());
    const OpenSides open{wraps_ || wide.column > 0, wide.row > 0,
                         wraps_ || wide.column + wide.columns < Columns(factor).count(),
                         wide.row + wide.rows < Rows(factor).count()};
    const std::vector<VoidRegion> regions = RegionsIn(*grid, window, open);
    if (std::ranges::any_of(regions, &VoidRegion::is_open)) continue;
    for (const VoidRegion& region : regions) {
      if (!region.is_large()) SolveHarmonic(region, *grid);
    }
    const auto guessed = GuessLarge(factor, window, regions, *grid, stop);
    if (!guessed) return tl::unexpected(guessed.error());
    return Cut(*grid, grid->heights, window);
  }
}

Result<std::vector<float>> RasterGrid::FillHoles(int factor, const GridWindow& window, const Bridged& bridged,
                                                 const std::stop_token& stop) const {
  if (options_.holes != HoleFill::kSmooth || bridged.voids == 0) return std::vector<float>();
  const auto holes = voids_.HolesIn(members_, member_index_, factor, window, Columns(factor).count(), bridged.heights);
  const GridWindow hull = HullOfMarks(holes, window);
  if (hull.columns == 0) return std::vector<float>();
  const auto smooth = ReadSmooth(factor, hull, false, stop);
  if (!smooth) return smooth;
  std::vector<float> filled = bridged.heights;
  CopyInto(*smooth, hull, window, filled);
  return filled;
}

}  // namespace terrace::dem

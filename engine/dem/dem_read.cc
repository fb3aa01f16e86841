// Reads heights of a dataset: each node takes its height from the first raster grid that has one, blended with those
// below where grids have a feather, else the floor.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "engine/bound/source_error_bound.h"
#include "engine/core/check.h"
#include "engine/crs/node_positions.h"
#include "engine/dem/dem_impl.h"
#include "engine/raster/nan_heights.h"

namespace terrace::dem {
namespace {

bool IsVoid(float height) { return std::isnan(height); }

// Up to this number of raster grids, each is asked for the whole window.
constexpr std::size_t kFewGrids = 8;
// Nodes around a raster grid's footprint whose positions are computed: the certified error needs those of each group of
// cells (SourceErrorBound::kGroup) that touches it, and one more.
constexpr int kAround = SourceErrorBound::kGroup + 1;

// The nodes at the ends of a range of lattice steps.
struct NodeRange {
  int first = std::numeric_limits<int>::max(), last = -1;

  void AddStep(int step) {
    first = std::min(first, step);
    last = std::max(last, step + 1);
  }
};

// The nodes of a window that may get heights from a raster grid, plus `around` more on each side. Where there are
// none, a window of one node: reading it checks the grid's files.
NodeWindow PartOf(const RasterGrid& grid, const geo::NodeGrid& node_grid, const NodeWindow& window, int around) {
  const Footprint& reach = grid.reach();
  const bool is_polar = grid.pole_heights()[0] || grid.pole_heights()[1];
  if (is_polar || reach.south <= -90 || reach.north >= 90 || reach.all_longitudes()) return window;
  if (window.rows < 2 || window.columns < 2) return window;
  NodeRange rows, columns;
  for (int j = 0; j + 1 < window.rows; ++j) {
    const auto [south, north] =
        std::minmax({node_grid.Latitude(window.row + j), node_grid.Latitude(window.row + j + 1)});
    if (north >= reach.south && south <= reach.north) rows.AddStep(j);
  }
  for (int i = 0; i + 1 < window.columns; ++i) {
    const double west = node_grid.Longitude(window.column + i), east = west + node_grid.StepDegrees();
    for (const int turn : {-360, 0, 360}) {
      if (east + turn >= reach.west && west + turn <= reach.east) columns.AddStep(i);
    }
  }
  if (rows.last < 0 || columns.last < 0) return {window.column, window.row, 1, 1};
  const auto grown = [around](NodeRange range, int count) {
    return NodeRange{std::max(range.first - around, 0), std::min(range.last + around, count - 1)};
  };
  const auto [west, east] = grown(columns, window.columns);
  const auto [south, north] = grown(rows, window.rows);
  return {window.column + west, window.row + south, east - west + 1, north - south + 1};
}

// Calls visit(node of the part, node of the window), for all nodes of the part.
template <typename Visit>
void ForPart(const NodeWindow& part, const NodeWindow& window, Visit&& visit) {
  const auto stride = static_cast<std::size_t>(window.columns);
  std::size_t of_part = 0;
  for (std::int64_t row = part.row; row < part.row + part.rows; ++row) {
    std::size_t of_window =
        static_cast<std::size_t>(row - window.row) * stride + static_cast<std::size_t>(part.column - window.column);
    for (int i = 0; i < part.columns; ++i) visit(of_part++, of_window++);
  }
}

// RasterGrid::FillNodes. If there are many raster grids, only for the part of the window that this one reaches: a
// shallow tile may have thousands of small ones, and their readings are kept until all heights are known.
Result<void> FillNodesOf(const RasterGrid& grid, const geo::NodeGrid& node_grid, const NodeWindow& window,
                         std::size_t grids, HeightDatum datum, const NodeHeights& nodes, const std::stop_token& stop,
                         PartReading* reading_of_part) {
  GridReading* const reading = reading_of_part != nullptr ? &reading_of_part->reading : nullptr;
  if (grids <= kFewGrids) return grid.FillNodes(node_grid, window, datum, nodes, stop, reading);
  const NodeWindow part = PartOf(grid, node_grid, window, 0);
  const auto copy = [&](std::span<const float> all) {
    std::vector<float> some(all.empty() ? 0 : Area(part.columns, part.rows));
    if (!all.empty()) ForPart(part, window, [&](std::size_t to, std::size_t from) { some[to] = all[from]; });
    return some;
  };
  const auto copy_back = [&](const std::vector<float>& some, std::span<float> all) {
    if (!some.empty()) ForPart(part, window, [&](std::size_t from, std::size_t to) { all[to] = some[from]; });
  };
  std::vector<float> heights = copy(nodes.heights), weights = copy(nodes.weights), hole_heights;
  if (nodes.hole_heights != nullptr) hole_heights = copy(*nodes.hole_heights);
  const auto done = grid.FillNodes(
      node_grid, part, datum,
      {heights, weights, nodes.hole_heights != nullptr ? &hole_heights : nullptr, nodes.are_void}, stop, reading);
  if (!done) return done;
  copy_back(heights, nodes.heights);
  copy_back(weights, nodes.weights);
  if (!hole_heights.empty() && nodes.hole_heights->empty()) *nodes.hole_heights = NaNHeights(nodes.heights.size());
  if (!hole_heights.empty()) copy_back(hole_heights, *nodes.hole_heights);
  if (reading_of_part != nullptr) {
    reading_of_part->part = part;
    reading->cells = {};  // saves memory; Widened computes them again
  }
  return done;
}

// Converts a reading of a part to one of the window. It has positions only within the raster grid's footprint and
// a margin.
GridReading Widened(PartReading&& of_part, const RasterGrid& grid, const geo::Lattice& lattice,
                    const NodeWindow& window) {
  if (!of_part.part) return std::move(of_part.reading);
  GridReading reading = std::move(of_part.reading);
  const std::size_t nodes = Area(window.columns, window.rows);
  std::vector<float> heights(nodes, SampleRules::kVoid);
  ForPart(*of_part.part, window, [&](std::size_t from, std::size_t to) { heights[to] = reading.heights[from]; });
  reading.heights = std::move(heights);
  reading.cells = grid.CellsOf(lattice, PartOf(grid, lattice, window, kAround), reading.factor, reading.window);
  if (!reading.undulations.empty()) {
    auto undulations = grid.undulations()->At(lattice, window);
    constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();  // the bound uses the geoid's range instead
    reading.undulations = undulations ? *std::move(undulations) : std::vector<double>(nodes, kUnknown);
  }
  return reading;
}

}  // namespace

BoxIndex IndexOf(const std::vector<RasterGrid>& grids) {
  std::vector<BoxIndex::Entry> entries;
  for (std::size_t i = 0; i < grids.size(); ++i) {
    const Footprint& reach = grids[i].reach();
    for (const int turn : {-360, 0, 360}) {
      entries.push_back({{reach.west + turn, reach.south, reach.east + turn, reach.north}, i});
    }
    for (const std::size_t pole : {0, 1}) {  // its height applies to every meridian
      const double latitude = pole == 0 ? -90 : 90;
      if (grids[i].pole_heights()[pole]) entries.push_back({{-540, latitude, 540, latitude}, i});
    }
  }
  return BoxIndex(entries);
}

// Combines the heights of raster grids. Without a feather, the first height is final. With a feather, heights are
// weighted, and the raster grids below get the rest. If there is no raster grid below, weights have no effect: nothing
// is blended with the floor.
class Blend {
 public:
  explicit Blend(std::size_t nodes) : sums_(nodes), open_(nodes, 1) {}

  // NaN at nodes that need further raster grids.
  std::vector<float> Wanted() const {
    std::vector<float> heights(sums_.size(), 0);
    for (std::size_t i = 0; i < heights.size(); ++i) {
      if (open_[i] > 0) heights[i] = SampleRules::kVoid;
    }
    return heights;
  }
  void Add(const std::vector<float>& heights, const std::vector<float>& weights) {
    for (std::size_t i = 0; i < heights.size(); ++i) {
      if (open_[i] <= 0 || std::isnan(heights[i])) continue;
      sums_[i] += open_[i] * weights[i] * heights[i];
      open_[i] *= 1 - weights[i];
    }
  }
  bool is_done() const {
    return std::ranges::none_of(open_, [](double share) { return share > 0; });
  }
  std::vector<float> Heights() const {
    std::vector<float> heights(sums_.size(), SampleRules::kVoid);
    for (std::size_t i = 0; i < heights.size(); ++i) {
      if (open_[i] < 1) heights[i] = RoundHeight(sums_[i] / (1 - open_[i]));
    }
    return heights;
  }

 private:
  std::vector<double> sums_;
  std::vector<double> open_;  // weight left for raster grids further down
};

Result<std::vector<float>> ElevationModel::Impl::ReadGrids(const geo::NodeGrid& node_grid, const NodeWindow& window,
                                                           HeightDatum datum, const std::string& what,
                                                           const std::stop_token& stop,
                                                           std::vector<PartReading>* readings) const {
  const std::size_t nodes = Area(window.columns, window.rows);
  std::vector<float> heights = NaNHeights(nodes), hole_heights;
  const std::vector<std::size_t> order = GridsAt(BoxOf(node_grid, window));
  const bool feathers = has_feather && order.size() > 1;
  Blend blend(feathers ? nodes : 0);
  bool are_void = true, has_voids = true;
  for (const std::size_t i : order) {
    std::vector<float> weights;
    if (feathers) {
      heights = blend.Wanted();
      weights.assign(nodes, 1);
    }
    PartReading* const reading = readings != nullptr ? &readings->emplace_back() : nullptr;
    const auto done = FillNodesOf(grids[i], node_grid, window, order.size(), datum,
                                  {heights, weights, &hole_heights, are_void}, stop, reading);
    if (!done) {
      return MakeError(done.error().code, "{}: {}", what, done.error().message);
    }
    if (feathers) blend.Add(heights, weights);
    are_void = false;
    if (!feathers) has_voids = HasVoids(heights);
    if (feathers ? blend.is_done() : !has_voids) break;
  }
  if (feathers) heights = blend.Heights();
  // A coarse measurement in a hole is better than a surface between the heights around it.
  if (hole_heights.empty() || !has_voids) return heights;
  for (std::size_t i = 0; i < nodes; ++i) {
    if (IsVoid(heights[i])) heights[i] = hole_heights[i];
  }
  return heights;
}

Box BoxOf(const geo::NodeGrid& node_grid, const NodeWindow& window) {
  constexpr double kSlack = 1e-9;
  const double west = node_grid.Longitude(window.column);
  const auto [south, north] =
      std::minmax({node_grid.Latitude(window.row), node_grid.Latitude(window.row + window.rows - 1)});
  return {west - kSlack, south - kSlack, west + (window.columns - 1) * node_grid.StepDegrees() + kSlack,
          north + kSlack};
}

std::vector<std::size_t> ElevationModel::Impl::GridsAt(const Box& box) const {
  // A single grid is read even where it has no heights. Reading checks its files, so that a tile of floor does not
  // outlive the dataset's only source.
  return grids.size() == 1 ? std::vector<std::size_t>{0} : index.Find(box);
}

std::vector<std::size_t> ElevationModel::Impl::GridsAt(const geo::TileKey& tile) const {
  const geo::Lattice& lattice = LatticeOf(tile.level);
  return GridsAt(BoxOf(lattice, WindowOfTile(lattice, tile)));
}

const geo::Lattice& ElevationModel::Impl::LatticeOf(int level) const {
  TERRACE_CHECK(level >= 0 && level < static_cast<int>(lattices.size()));
  return lattices[static_cast<std::size_t>(level)];
}

Result<void> ElevationModel::Impl::FillWithFloor(const geo::NodeGrid& node_grid, const NodeWindow& window,
                                                 HeightDatum datum, std::span<float> heights) const {
  if (datum == HeightDatum::kEllipsoid || floor_undulations == nullptr || !HasVoids(heights)) {
    ReplaceVoids(heights, floor);
    return {};
  }
  const auto undulations = floor_undulations->At(node_grid, window);
  if (!undulations) return tl::unexpected(undulations.error());
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (!IsVoid(heights[i])) continue;
    heights[i] = std::isnan((*undulations)[i]) ? floor : RoundHeight(floor - (*undulations)[i]);
  }
  return {};
}

Result<std::vector<float>> ElevationModel::Impl::ReadUnedited(const geo::NodeGrid& node_grid, const NodeWindow& window,
                                                              HeightDatum datum, const std::string& what,
                                                              const std::stop_token& stop,
                                                              std::vector<PartReading>* readings) const {
  auto heights = ReadGrids(node_grid, window, datum, what, stop, readings);
  if (!heights) return heights;
  if (const auto filled = FillWithFloor(node_grid, window, datum, *heights); !filled) {
    return tl::unexpected(filled.error());
  }
  return heights;
}

Result<std::vector<float>> ElevationModel::Impl::ReadNodes(const geo::NodeGrid& node_grid, const NodeWindow& window,
                                                           HeightDatum datum, const std::string& what,
                                                           const std::stop_token& stop) const {
  if (floor_undulations == nullptr) datum = HeightDatum::kEllipsoid;  // the same heights
  auto heights = ReadUnedited(node_grid, window, datum, what, stop);
  if (!heights) return heights;
  const std::vector<std::size_t> which = EditsAt(node_grid, window);
  if (which.empty()) return heights;
  const auto undulations = DatumUndulations(node_grid, window, which, datum, *heights, what, stop);
  if (!undulations) return tl::unexpected(undulations.error());
  if (auto edited = ApplyEdits(node_grid, window, which, {datum, *undulations}, *heights, stop); !edited) {
    return tl::unexpected(std::move(edited).error());
  }
  return heights;
}

Result<TileHeights> ElevationModel::Impl::Read(const geo::TileKey& key, HeightDatum datum,
                                               const std::stop_token& stop) const {
  const geo::Lattice& lattice = LatticeOf(key.level);
  const NodeWindow window = WindowOfTile(lattice, key);
  const std::string what = "tile " + geo::ToString(key);
  const bool is_certified = datum == HeightDatum::kEllipsoid;
  std::vector<PartReading> readings;
  if (!is_certified) {
    auto read = ReadNodes(lattice, window, datum, what, stop);
    if (!read) return tl::unexpected(std::move(read).error());
    return TileHeights{lattice, lattice.cells + 3, *std::move(read)};
  }
  auto heights = ReadUnedited(lattice, window, datum, what, stop, &readings);
  if (!heights) return tl::unexpected(std::move(heights).error());
  TileHeights tile{lattice, lattice.cells + 3, *std::move(heights)};
  const auto bound = BoundError(tile, window, std::move(readings), stop);
  if (!bound) return MakeError(bound.error().code, "{}: {}", what, bound.error().message);
  tile.source_error_m = *bound;
  if (const auto which = EditsAt(lattice, window); !which.empty()) {
    const auto edited = ApplyEdits(lattice, window, which, {}, tile.heights, stop, &tile.source_error_m);
    if (!edited) return MakeError(edited.error().code, "{}: {}", what, edited.error().message);
  }
  return tile;
}

// `readings`: of the raster grids that were read for the heights, in order of precedence.
Result<double> ElevationModel::Impl::BoundError(const TileHeights& tile, const NodeWindow& window,
                                                std::vector<PartReading> readings, const std::stop_token& stop,
                                                bool counts_between) const {
  const std::vector<std::size_t> order = GridsAt(BoxOf(tile.lattice, window));
  SourceErrorBound bound(tile.lattice, window, tile.heights, has_feather && order.size() > 1, counts_between);
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const RasterGrid& grid = grids[order[k]];
    const GridReading reading = Widened(std::move(readings[k]), grid, tile.lattice, window);
    if (const auto added = bound.Add(grid, reading, stop); !added) return tl::unexpected(added.error());
  }
  // All nodes have a height, but samples of further raster grids may still be visible between them.
  std::vector<float> none_wanted;
  for (std::size_t k = readings.size(); k < order.size() && !bound.is_covered(); ++k) {
    const RasterGrid& grid = grids[order[k]];
    if (none_wanted.empty()) none_wanted = tile.heights;
    PartReading reading_of_part;
    const auto done = FillNodesOf(grid, tile.lattice, window, order.size(), HeightDatum::kEllipsoid, {none_wanted},
                                  stop, &reading_of_part);
    if (!done) return tl::unexpected(done.error());
    const GridReading reading = Widened(std::move(reading_of_part), grid, tile.lattice, window);
    if (const auto added = bound.Add(grid, reading, stop); !added) return tl::unexpected(added.error());
  }
  return bound.bound();
}

Result<std::vector<float>> ElevationModel::ReadNodes(int level, const NodeWindow& window, std::stop_token stop) const {
  TERRACE_CHECK(level >= 0 && level <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows - 1 <= LatticeOf(level).rows());
  return impl_->ReadNodes(LatticeOf(level), window, HeightDatum::kEllipsoid, fmt::format("an area of level {}", level),
                          stop);
}

Result<std::vector<float>> ElevationModel::ReadMercator(int depth, const NodeWindow& window,
                                                        std::stop_token stop) const {
  TERRACE_CHECK(depth >= 0 && depth <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows <= geo::MercatorGrid{depth}.rows());
  return impl_->ReadNodes(geo::MercatorGrid{depth}, window, HeightDatum::kEllipsoid,
                          fmt::format("Mercator pixels of depth {}", depth), stop);
}

Result<std::vector<float>> ElevationModel::ReadKnownMercator(int depth, const NodeWindow& window, HeightDatum datum,
                                                             std::stop_token stop) const {
  TERRACE_CHECK(depth >= 0 && depth <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows <= geo::MercatorGrid{depth}.rows());
  if (!has_geoid()) datum = HeightDatum::kEllipsoid;  // the same heights
  const geo::MercatorGrid grid{depth};
  const std::string what = fmt::format("Mercator pixels of depth {}", depth);
  auto known = impl_->ReadGrids(grid, window, datum, what, stop, nullptr);
  if (!known) return known;
  const auto which = impl_->EditsAt(grid, window);
  if (which.empty()) return known;
  std::vector<float> unedited = *known;
  if (const auto filled = impl_->FillWithFloor(grid, window, datum, unedited); !filled) {
    return tl::unexpected(filled.error());
  }
  const auto undulations = impl_->DatumUndulations(grid, window, which, datum, unedited, what, stop);
  if (!undulations) return tl::unexpected(undulations.error());
  const bool has_voids = HasVoids(*known);
  if (const auto done = impl_->ApplyEdits(grid, window, which, {datum, *undulations}, *known, stop); !done) {
    return tl::unexpected(done.error());
  }
  if (!has_voids) return known;
  std::vector<float> edited = unedited;
  if (const auto done = impl_->ApplyEdits(grid, window, which, {datum, *undulations}, edited, stop); !done) {
    return tl::unexpected(done.error());
  }
  // A void that is left in `known` was not set by an edit. An edit that blends into the floor shows there as well.
  for (std::size_t i = 0; i < edited.size(); ++i) {
    if (IsVoid((*known)[i]) && edited[i] != unedited[i]) (*known)[i] = edited[i];
  }
  return known;
}

Result<std::vector<float>> ElevationModel::ReadPoints(std::span<const GeoPosition> points, HeightDatum datum,
                                                      std::stop_token stop, std::span<std::uint8_t> filled) const {
  auto heights = impl_->PointsUnedited(points, datum, stop, filled);
  if (!heights || impl_->edits == nullptr) return heights;
  if (const auto edited = impl_->EditPoints(points, datum, *heights, stop); !edited) {
    return tl::unexpected(edited.error());
  }
  return heights;
}

Result<std::vector<float>> ElevationModel::Impl::PointsUnedited(std::span<const GeoPosition> points, HeightDatum datum,
                                                                const std::stop_token& stop,
                                                                std::span<std::uint8_t> filled) const {
  TERRACE_CHECK(filled.empty() || filled.size() == points.size());
  std::ranges::fill(filled, std::uint8_t{0});
  std::vector<float> heights(points.size(), SampleRules::kVoid), hole_heights = heights;
  const auto take_from_holes = [&] {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!std::isnan(heights[i]) || std::isnan(hole_heights[i])) continue;
      heights[i] = hole_heights[i];
      if (!filled.empty()) filled[i] = 1;
    }
  };
  if (grids.size() == 1) {
    std::vector<std::uint8_t> own(filled.empty() ? points.size() : 0);
    const std::span<std::uint8_t> marks = filled.empty() ? std::span(own) : filled;
    const auto read = grids.front().FillPoints(points, datum, {heights, {}, &hole_heights}, marks, stop);
    if (!read) return tl::unexpected(read.error());
    take_from_holes();
    return heights;
  }
  std::map<std::size_t, std::vector<std::size_t>> wanted;  // points by the raster grids that may have heights for them
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = std::remainder(points[i].longitude, 360), y = points[i].latitude;
    for (const std::size_t grid : GridsAt({x, y, x, y})) wanted[grid].push_back(i);
  }
  std::vector<GeoPosition> missing;
  std::vector<float> found, found_in_holes;
  std::vector<std::uint8_t> found_filled;
  for (auto& [grid, those] : wanted) {
    std::erase_if(those, [&](std::size_t i) { return !std::isnan(heights[i]); });
    missing.clear();
    for (const std::size_t i : those) missing.push_back(points[i]);
    found.assign(those.size(), SampleRules::kVoid);
    found_in_holes = found;
    found_filled.assign(those.size(), 0);
    const auto read = grids[grid].FillPoints(missing, datum, {found, {}, &found_in_holes}, found_filled, stop);
    if (!read) return tl::unexpected(read.error());
    for (std::size_t k = 0; k < those.size(); ++k) {
      heights[those[k]] = found[k];
      if (!filled.empty()) filled[those[k]] = found_filled[k];
      if (std::isnan(hole_heights[those[k]])) hole_heights[those[k]] = found_in_holes[k];
    }
  }
  take_from_holes();
  return heights;
}

HeightRange ElevationModel::Impl::UneditedRange(const geo::Lattice& lattice, const geo::TileKey& key) const {
  BlockRange blocks;
  bool floor_shows = true;
  for (const std::size_t i : GridsAt(BoxOf(lattice, WindowOfTile(lattice, key)))) {
    const GridRange range = grids[i].RangeOf(lattice, key);
    blocks.Add(range.blocks);
    floor_shows = range.shows_others;
    if (!floor_shows) break;  // all later ones are hidden
  }
  if (blocks.min > blocks.max) return {floor, floor};
  // Multiples of 2^-10 m: rounding stays within these.
  HeightRange bound{std::floor(blocks.min * 1024.0) / 1024, std::ceil(blocks.max * 1024.0) / 1024};
  if (floor_shows) bound = {std::min<double>(bound.min, floor), std::max<double>(bound.max, floor)};
  return bound;
}

HeightRange ElevationModel::RangeBound(const geo::TileKey& key) const {
  TERRACE_CHECK(geo::IsValid(key));
  const geo::Lattice& lattice = impl_->LatticeOf(key.level);
  const HeightRange range = impl_->UneditedRange(lattice, key);
  const auto which = impl_->EditsAt(lattice, WindowOfTile(lattice, key));
  if (which.empty()) return range;
  return impl_->edits->Extended(range, which,
                                [&](const Edit& edit) { return impl_->RangeOfReplacement(edit, lattice, key); });
}

}  // namespace terrace::dem

// Heights of a dataset: each node takes the first sheet that has one there, then the floor.
#include <algorithm>
#include <cmath>
#include <map>

#include "engine/core/check.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/node_positions.h"
#include "engine/dem/source_gap.h"

namespace terrace::dem {
namespace {

bool IsVoid(float height) { return std::isnan(height); }

Result<void> FillFrom(const Sheet& sheet, const geo::Lattice& lattice, const NodeWindow& window, Counting counting,
                      std::span<float> heights, const std::stop_token& stop, std::span<float> weights,
                      SheetTrace* trace) {
  return sheet.Fill(lattice, window, counting, heights, stop, weights, trace);
}
Result<void> FillFrom(const Sheet& sheet, const geo::MercatorGrid& grid, const NodeWindow& window, Counting,
                      std::span<float> heights, const std::stop_token& stop, std::span<float> weights, SheetTrace*) {
  return sheet.Fill(grid, window, heights, stop, weights);
}

// Around the nodes of a window. Their longitudes begin between -180 and 180, and go on eastwards.
template <typename Grid>
Box BoxOf(const Grid& grid, const NodeWindow& window) {
  constexpr double kSlack = 1e-9;
  const double west = grid.Longitude(window.column);
  const auto [south, north] = std::minmax({grid.Latitude(window.row), grid.Latitude(window.row + window.rows - 1)});
  return {west - kSlack, south - kSlack, west + (window.columns - 1) * grid.StepDegrees() + kSlack, north + kSlack};
}

}  // namespace

BoxIndex IndexOf(const std::vector<Sheet>& sheets) {
  std::vector<BoxIndex::Entry> entries;
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    const Footprint& reach = sheets[i].reach();
    for (const int turn : {-360, 0, 360}) {
      entries.push_back({{reach.west + turn, reach.south, reach.east + turn, reach.north}, i});
    }
    for (const std::size_t pole : {0, 1}) {  // its height counts on every meridian
      const double latitude = pole == 0 ? -90 : 90;
      if (sheets[i].pole_heights()[pole]) entries.push_back({{-540, latitude, 540, latitude}, i});
    }
  }
  return BoxIndex(entries);
}

// Heights of sheets over each other. Without a feather a sheet's height is the last word; with one it counts by its
// weight, and what lies below it has the rest. Where nothing lies below, the weight changes nothing: nothing is blended
// with the floor.
class Blend {
 public:
  explicit Blend(std::size_t nodes) : sums_(nodes), open_(nodes, 1) {}

  // NaN where more is wanted.
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
  std::vector<double> open_;  // share that sheets further down have
};

template <typename Grid>
Result<std::vector<float>> DemSource::Impl::ReadSheets(const Grid& grid, const NodeWindow& window, Counting counting,
                                                       const std::string& what, const std::stop_token& stop,
                                                       std::vector<SheetTrace>* traces) const {
  const std::size_t nodes = static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows);
  std::vector<float> heights(nodes, SampleRules::kVoid);
  const std::vector<std::size_t> order = SheetsAt(BoxOf(grid, window));
  const bool feathers = has_feather && order.size() > 1;
  Blend blend(feathers ? nodes : 0);
  for (const std::size_t i : order) {
    std::vector<float> weights;
    if (feathers) {
      heights = blend.Wanted();
      weights.assign(nodes, 1);
    }
    SheetTrace* const trace = traces != nullptr ? &traces->emplace_back() : nullptr;
    if (const auto filled = FillFrom(sheets[i], grid, window, counting, heights, stop, weights, trace); !filled) {
      return MakeError(filled.error().code, "{}: {}", what, filled.error().message);
    }
    if (feathers) blend.Add(heights, weights);
    if (feathers ? blend.is_done() : std::ranges::none_of(heights, IsVoid)) break;
  }
  if (feathers) heights = blend.Heights();
  return heights;
}

std::vector<std::size_t> DemSource::Impl::SheetsAt(const Box& box) const {
  // A tile of floor must not outlive a dataset's only source: it is looked at in any case.
  return sheets.size() == 1 ? std::vector<std::size_t>{0} : index.Find(box);
}

const geo::Lattice& DemSource::Impl::LatticeOf(int level) const {
  TERRACE_CHECK(level >= 0 && level < static_cast<int>(lattices.size()));
  return lattices[static_cast<std::size_t>(level)];
}

Result<std::vector<float>> DemSource::Impl::ReadNodes(int level, const NodeWindow& window, Counting counting,
                                                      const std::string& what, const std::stop_token& stop,
                                                      std::vector<SheetTrace>* traces) const {
  const geo::Lattice& lattice = LatticeOf(level);
  auto heights = ReadSheets(lattice, window, counting, what, stop, traces);
  if (!heights || std::ranges::none_of(*heights, IsVoid)) return heights;
  if (counting == Counting::kEllipsoid || floor_undulations == nullptr) {
    std::ranges::replace_if(*heights, IsVoid, floor);
    return heights;
  }
  const std::vector<double> undulations = floor_undulations->At(lattice, window);
  for (std::size_t i = 0; i < heights->size(); ++i) {
    if (!IsVoid((*heights)[i])) continue;
    (*heights)[i] = std::isnan(undulations[i]) ? floor : RoundHeight(floor - undulations[i]);
  }
  return heights;
}

Result<TileHeights> DemSource::Impl::Read(const geo::TileKey& key, Counting counting,
                                          const std::stop_token& stop) const {
  const geo::Lattice& lattice = LatticeOf(key.level);
  const NodeWindow window = WindowOfTile(lattice, key);
  const std::string what = "tile " + geo::ToString(key);
  const bool is_certified = counting == Counting::kEllipsoid;
  std::vector<SheetTrace> traces;
  auto heights = ReadNodes(key.level, window, counting, what, stop, is_certified ? &traces : nullptr);
  if (!heights) return tl::unexpected(std::move(heights).error());
  TileHeights tile{lattice, lattice.cells + 3, *std::move(heights)};
  if (!is_certified) return tile;
  const auto gap = GapOf(tile, window, traces, stop);
  if (!gap) return MakeError(gap.error().code, "{}: {}", what, gap.error().message);
  tile.source_gap_m = *gap;
  return tile;
}

// `traces`: of the sheets that were read for the heights, the first of the tile's.
Result<double> DemSource::Impl::GapOf(const TileHeights& tile, const NodeWindow& window,
                                      const std::vector<SheetTrace>& traces, const std::stop_token& stop) const {
  const std::vector<std::size_t> order = SheetsAt(BoxOf(tile.lattice, window));
  SourceGap gap(tile.lattice, window, tile.heights, has_feather && order.size() > 1);
  for (std::size_t k = 0; k < traces.size(); ++k) {
    if (const auto added = gap.Add(sheets[order[k]], traces[k], stop); !added) return tl::unexpected(added.error());
  }
  // All nodes have their height; samples of further sheets may still show between them.
  std::vector<float> none_wanted = tile.heights;
  for (std::size_t k = traces.size(); k < order.size() && !gap.is_covered(); ++k) {
    const Sheet& sheet = sheets[order[k]];
    SheetTrace trace;
    const auto filled = sheet.Fill(tile.lattice, window, Counting::kEllipsoid, none_wanted, stop, {}, &trace);
    if (!filled) return tl::unexpected(filled.error());
    if (const auto added = gap.Add(sheet, trace, stop); !added) return tl::unexpected(added.error());
  }
  return gap.bound();
}

Result<std::vector<float>> DemSource::Impl::ReadMercator(int depth, const NodeWindow& window,
                                                         const std::stop_token& stop) const {
  auto heights = ReadSheets(geo::MercatorGrid{depth}, window, Counting::kEllipsoid,
                            fmt::format("Mercator pixels of depth {}", depth), stop, nullptr);
  if (heights) std::ranges::replace_if(*heights, IsVoid, floor);
  return heights;
}

Result<std::vector<float>> DemSource::Impl::ReadPoints(std::span<const GeoPosition> points, HeightDatum datum,
                                                       const std::stop_token& stop) const {
  std::vector<float> heights(points.size(), SampleRules::kVoid);
  std::map<std::size_t, std::vector<std::size_t>> wanted;  // points by the sheets that may have them
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = std::remainder(points[i].longitude, 360), y = points[i].latitude;
    for (const std::size_t sheet : SheetsAt({x, y, x, y})) wanted[sheet].push_back(i);
  }
  std::vector<GeoPosition> missing;
  std::vector<float> found;
  for (auto& [sheet, those] : wanted) {
    std::erase_if(those, [&](std::size_t i) { return !std::isnan(heights[i]); });
    missing.clear();
    for (const std::size_t i : those) missing.push_back(points[i]);
    found.assign(those.size(), SampleRules::kVoid);
    if (const auto filled = sheets[sheet].FillPoints(missing, datum, found, stop); !filled) {
      return tl::unexpected(filled.error());
    }
    for (std::size_t k = 0; k < those.size(); ++k) heights[those[k]] = found[k];
  }
  return heights;
}

HeightRange DemSource::Impl::RangeBound(const geo::TileKey& key) const {
  BlockRange blocks;
  bool floor_shows = true;
  const geo::Lattice& lattice = LatticeOf(key.level);
  for (const std::size_t i : SheetsAt(BoxOf(lattice, WindowOfTile(lattice, key)))) {
    const SheetRange range = sheets[i].RangeOf(lattice, key);
    blocks.Add(range.blocks);
    floor_shows = range.shows_others;
    if (!floor_shows) break;  // whatever comes after it is hidden
  }
  if (blocks.min > blocks.max) return {floor, floor};
  // Rounding to 2^-10 m stays within these.
  HeightRange bound{std::floor(blocks.min * 1024.0) / 1024, std::ceil(blocks.max * 1024.0) / 1024};
  if (floor_shows) bound = {std::min<double>(bound.min, floor), std::max<double>(bound.max, floor)};
  return bound;
}

}  // namespace terrace::dem

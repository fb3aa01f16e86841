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

template <typename Grid>
Result<std::vector<float>> DemSource::Impl::ReadFloored(const Grid& grid, const NodeWindow& window,
                                                        const std::string& what, const std::stop_token& stop) const {
  std::vector<float> heights(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                             SampleRules::kVoid);
  for (const std::size_t i : SheetsAt(BoxOf(grid, window))) {
    if (const auto filled = sheets[i].Fill(grid, window, heights, stop); !filled) {
      return MakeError(filled.error().code, "{}: {}", what, filled.error().message);
    }
    if (std::ranges::none_of(heights, [](float height) { return std::isnan(height); })) break;
  }
  std::ranges::replace_if(
      heights, [](float height) { return std::isnan(height); }, floor);
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

Result<std::vector<float>> DemSource::Impl::ReadNodes(int level, const NodeWindow& window, const std::string& what,
                                                      const std::stop_token& stop) const {
  return ReadFloored(LatticeOf(level), window, what, stop);
}

Result<TileHeights> DemSource::Impl::Read(const geo::TileKey& key, const std::stop_token& stop) const {
  const geo::Lattice& lattice = LatticeOf(key.level);
  const NodeWindow window = WindowOfTile(lattice, key);
  TileHeights tile{lattice, lattice.cells + 3, {}};
  tile.heights.resize(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                      SampleRules::kVoid);
  const auto is_missing = [](float height) { return std::isnan(height); };
  const std::vector<std::size_t> those = SheetsAt(BoxOf(lattice, window));
  std::vector<SheetTrace> traces;
  const auto fill = [&](std::size_t i) {
    return sheets[i].Fill(lattice, window, tile.heights, stop, &traces.emplace_back());
  };
  const auto failed = [&](const Error& error) {
    return MakeError(error.code, "tile {}: {}", geo::ToString(key), error.message);
  };
  while (traces.size() < those.size() && std::ranges::any_of(tile.heights, is_missing)) {
    if (const auto filled = fill(those[traces.size()]); !filled) return failed(filled.error());
  }
  std::ranges::replace_if(tile.heights, is_missing, floor);
  SourceGap gap(lattice, window, tile.heights);
  for (std::size_t k = 0; k < traces.size(); ++k) gap.Add(sheets[those[k]], traces[k]);
  // All nodes have their height; samples of further sheets may still show between them.
  while (traces.size() < those.size() && !gap.is_covered()) {
    const std::size_t i = those[traces.size()];
    if (const auto filled = fill(i); !filled) return failed(filled.error());
    gap.Add(sheets[i], traces.back());
  }
  tile.source_gap_m = gap.bound();
  return tile;
}

Result<std::vector<float>> DemSource::Impl::ReadMercator(int depth, const NodeWindow& window,
                                                         const std::stop_token& stop) const {
  return ReadFloored(geo::MercatorGrid{depth}, window, fmt::format("Mercator pixels of depth {}", depth), stop);
}

Result<std::vector<float>> DemSource::Impl::ReadPoints(std::span<const GeoPosition> points,
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
    if (const auto filled = sheets[sheet].FillPoints(missing, found, stop); !filled) {
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

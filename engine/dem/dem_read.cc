// Heights of a dataset: each node takes the first sheet that has one there, then the floor.
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/check.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/node_positions.h"
#include "engine/dem/source_gap.h"

namespace terrace::dem {
namespace {

template <typename Grid>
Result<std::vector<float>> ReadFloored(std::span<const Sheet> sheets, float floor, const Grid& grid,
                                       const NodeWindow& window, const std::string& what, const std::stop_token& stop) {
  std::vector<float> heights(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                             SampleRules::kVoid);
  for (const Sheet& sheet : sheets) {
    if (const auto filled = sheet.Fill(grid, window, heights, stop); !filled) {
      return MakeError(filled.error().code, "{}: {}", what, filled.error().message);
    }
  }
  std::ranges::replace_if(
      heights, [](float height) { return std::isnan(height); }, floor);
  return heights;
}

}  // namespace

const geo::Lattice& DemSource::Impl::LatticeOf(int level) const {
  TERRACE_CHECK(level >= 0 && level < static_cast<int>(lattices.size()));
  return lattices[static_cast<std::size_t>(level)];
}

Result<std::vector<float>> DemSource::Impl::ReadNodes(int level, const NodeWindow& window, const std::string& what,
                                                      const std::stop_token& stop) const {
  return ReadFloored(sheets, floor, LatticeOf(level), window, what, stop);
}

Result<TileHeights> DemSource::Impl::Read(const geo::TileKey& key, const std::stop_token& stop) const {
  const geo::Lattice& lattice = LatticeOf(key.level);
  const NodeWindow window = WindowOfTile(lattice, key);
  TileHeights tile{lattice, lattice.cells + 3, {}};
  tile.heights.resize(static_cast<std::size_t>(window.columns) * static_cast<std::size_t>(window.rows),
                      SampleRules::kVoid);
  std::vector<SheetTrace> traces(sheets.size());
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    if (const auto filled = sheets[i].Fill(lattice, window, tile.heights, stop, &traces[i]); !filled) {
      return MakeError(filled.error().code, "tile {}: {}", geo::ToString(key), filled.error().message);
    }
  }
  std::ranges::replace_if(
      tile.heights, [](float height) { return std::isnan(height); }, floor);
  SourceGap gap(lattice, window, tile.heights);
  for (std::size_t i = 0; i < sheets.size(); ++i) gap.Add(sheets[i], traces[i]);
  tile.source_gap_m = gap.bound();
  return tile;
}

Result<std::vector<float>> DemSource::Impl::ReadMercator(int depth, const NodeWindow& window,
                                                         const std::stop_token& stop) const {
  return ReadFloored(sheets, floor, geo::MercatorGrid{depth}, window, fmt::format("Mercator pixels of depth {}", depth),
                     stop);
}

Result<std::vector<float>> DemSource::Impl::ReadPoints(std::span<const GeoPosition> points,
                                                       const std::stop_token& stop) const {
  std::vector<float> heights(points.size(), SampleRules::kVoid);
  for (const Sheet& sheet : sheets) {
    if (const auto filled = sheet.FillPoints(points, heights, stop); !filled) return tl::unexpected(filled.error());
  }
  return heights;
}

HeightRange DemSource::Impl::RangeBound(const geo::TileKey& key) const {
  BlockRange blocks;
  bool floor_shows = true;
  for (const Sheet& sheet : sheets) {
    const SheetRange range = sheet.RangeOf(LatticeOf(key.level), key);
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

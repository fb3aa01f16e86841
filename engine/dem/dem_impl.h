// The state of a DemSource. Immutable after Open.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/dem/dem_source.h"
#include "engine/dem/mosaic/raster_grid.h"

namespace terrace::dem {

// The trace of RasterGrid::Fill for a window, or for `part` of it; then it has no positions.
struct PartTrace {
  std::optional<NodeWindow> part = {};
  GridTrace trace = {};
};

// What the heights of a raster grid depend on, for DemSource::ContentBelow.
struct GridContent {
  ContentHash grid;                  // its pixel grid, vertical datum and geoid
  std::vector<ContentHash> members;  // samples, positions and rules for voids, by member
};

class DemSource::Impl {
 public:
  // `what`: names the request in messages. `traces`, unless null, receives the traces of the raster grids that were
  // read, in order.
  Result<std::vector<float>> ReadNodes(int level, const NodeWindow& window, HeightDatum datum, const std::string& what,
                                       const std::stop_token& stop, std::vector<PartTrace>* traces = nullptr) const;
  Result<TileHeights> Read(const geo::TileKey& key, HeightDatum datum, const std::stop_token& stop) const;

  const geo::Lattice& LatticeOf(int level) const;  // 0 .. geo::kMaxLevel, also beyond the deepest level served

  template <typename NodeGrid>
  Result<std::vector<float>> ReadGrids(const NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                                       const std::string& what, const std::stop_token& stop,
                                       std::vector<PartTrace>* traces) const;
  Result<double> BoundError(const TileHeights& tile, const NodeWindow& window, std::vector<PartTrace> traces,
                            const std::stop_token& stop) const;
  // The raster grids that may have heights in the box, in order of precedence.
  std::vector<std::size_t> GridsAt(const Box& degrees) const;
  std::vector<std::size_t> GridsNear(const geo::TileKey& tile) const;

  std::vector<RasterGrid> grids;  // in order of precedence
  BoxIndex index;                 // of the raster grids, by degrees (IndexOf)
  std::vector<geo::Lattice> lattices;
  std::vector<std::vector<geo::TileRange>> available;
  float floor = 0;  // above the ellipsoid
  // For the whole Earth, of the last raster grid that refers to a geoid; or null.
  std::shared_ptr<const Undulations> floor_undulations;
  bool has_feather = false;
  DemInfo info;
  std::uint64_t fingerprint = 0;
  std::vector<GridContent> contents;  // by raster grid
};

// An index of raster grids by the box in degrees where they may have heights. Longitudes from -540 to 540, with one
// entry for each turn around the Earth that begins there.
BoxIndex IndexOf(const std::vector<RasterGrid>& grids);

}  // namespace terrace::dem

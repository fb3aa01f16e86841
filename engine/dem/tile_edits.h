// What the edits of a model mean for its tiles (docs/edits.md).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/edits/edit_effects.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// Without edits all results except that of AvailabilityToDepthOf are 0 or empty. Thread-safe.
class TileEdits {
 public:
  // `model` must outlive this object.
  explicit TileEdits(const ElevationModel& model) : model_(*model.impl_) {}

  // The requirements of edits for the mesh of a tile. Precondition: a valid key.
  MeshDemands DemandsOf(const geo::TileKey& key) const;
  // The same for nodes of a level's lattice. Columns wrap at 360 degrees.
  MeshDemands DemandsOf(int level, const NodeWindow& window) const;
  // The same for the edges that end at a corner of the tile and are not its own: for each corner (south-west,
  // south-east, north-east, north-west) one MeshDemands per such edge, for the edge's nodes without its two ends.
  std::array<std::vector<MeshDemands>, 4> DemandsBeyondCorners(const geo::TileKey& key) const;

  // A hash of the edits that a tile's bytes depend on; 0: edits do not change its bytes. `MercatorHash`: for pixels as
  // ElevationModel::ReadMercator has them. Cheap after the first call for a tile.
  std::uint64_t Hash(const geo::TileKey& key) const;
  std::uint64_t MercatorHash(int depth, const NodeWindow& window) const;
  // A hash of all available tiles below a tile if edits added some of them; 0: they added none.
  std::uint64_t DeeperTilesHash(const geo::TileKey& key) const;
  // The levels of Availability() from 0 to the deepest one that has a tile below `key`, or to max_source_level() if
  // that is deeper.
  std::span<const std::vector<geo::TileRange>> AvailabilityToDepthOf(const geo::TileKey& key) const;

  std::vector<EditOutline> Outlines() const;

 private:
  const ElevationModel::Impl& model_;
};

}  // namespace terrace::dem

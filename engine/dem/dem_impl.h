// Private: the state of an ElevationModel. Immutable after Open.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/edits/edit_set.h"
#include "engine/gdal/stamped_files.h"
#include "engine/geo/node_grid.h"
#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {

// What RasterGrid::FillNodes read for a window, which the certified error needs. If `part` is set, `reading` is of
// that part of the window only, and `reading.cells` is empty.
struct PartReading {
  std::optional<NodeWindow> part = {};
  GridReading reading = {};
};

// What the heights of a raster grid depend on, for ContentBelow.
struct GridContent {
  ContentHash grid;                  // its pixel grid, vertical datum and geoid
  std::vector<ContentHash> members;  // samples, positions and rules for voids, by member
};

class ElevationModel::Impl {
 public:
  // `what`: names the request in messages.
  Result<std::vector<float>> ReadNodes(const geo::NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                                       const std::string& what, const std::stop_token& stop) const;
  // The same before the edits. `readings`: unless null, receives the readings of the raster grids that were read, in
  // order.
  Result<std::vector<float>> ReadUnedited(const geo::NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                                          const std::string& what, const std::stop_token& stop,
                                          std::vector<PartReading>* readings = nullptr) const;
  // Replaces NaN by the floor, in the datum of the last raster grid that refers to a geoid, or above the ellipsoid.
  Result<void> FillWithFloor(const geo::NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                             std::span<float> heights) const;
  Result<TileHeights> Read(const geo::TileKey& key, HeightDatum datum, const std::stop_token& stop) const;

  const geo::Lattice& LatticeOf(int level) const;  // 0 .. geo::kMaxLevel, also beyond the deepest level served

  Result<std::vector<float>> ReadGrids(const geo::NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                                       const std::string& what, const std::stop_token& stop,
                                       std::vector<PartReading>* readings) const;
  // `counts_between`: as for SourceErrorBound.
  Result<double> BoundError(const TileHeights& tile, const NodeWindow& window, std::vector<PartReading> readings,
                            const std::stop_token& stop, bool counts_between = false) const;
  // The raster grids that may have heights in the box, in order of precedence.
  std::vector<std::size_t> GridsAt(const Box& degrees) const;
  std::vector<std::size_t> GridsAt(const geo::TileKey& tile) const;

  // Edits. Defined in dem_edits.cc, if no other file is named.
  Result<void> OpenEdits(const DemOptions& options);
  void AddDeeperLevels(double error_fraction);  // dem_deeper.cc
  // These complete an edit with what the sources tell, and return what is wrong with it; empty: nothing. `opened`: the
  // replacements by path, as indexes.
  Result<std::string> ResolveEdit(Edit& edit, const DemOptions& options, std::map<std::string, std::size_t>& opened);
  // Of an edit with orthometric heights. dem_edit_datum.cc.
  Result<std::string> AddUndulations(Edit& edit) const;
  // Whether all heights in the box `reach`, read in `datum`, are above `geoid` (GeoidIn): those of the sources there,
  // and with kSource the floor. dem_edit_datum.cc.
  bool AreHeightsAbove(const std::string& geoid, HeightDatum datum, const Box& reach) const;
  // EditedDatum::undulations at a window's nodes; empty: no edit needs them. `unedited`: heights in `datum`.
  // dem_edit_datum.cc.
  Result<std::vector<double>> DatumUndulations(const geo::NodeGrid& node_grid, const NodeWindow& window,
                                               std::span<const std::size_t> which, HeightDatum datum,
                                               std::span<const float> unedited, const std::string& what,
                                               const std::stop_token& stop) const;
  // Of a flatten without a height.
  Result<std::string> AddFlatHeight(Edit& edit, const std::stop_token& stop) const;
  // Of a replace.
  Result<std::string> OpenReplacement(Edit& edit, const DemOptions& options,
                                      std::map<std::string, std::size_t>& opened);
  // `error_m`: as for EditSet::Apply.
  Result<void> ApplyEdits(const geo::NodeGrid& node_grid, const NodeWindow& window, std::span<const std::size_t> which,
                          const EditedDatum& datum, std::span<float> heights, const std::stop_token& stop,
                          double* error_m = nullptr) const;
  // ReplacementHeights::void_cells. `readings`: of this model, for the window. dem_replacement_voids.cc.
  std::vector<std::uint8_t> VoidCells(const geo::Lattice& lattice, const NodeWindow& window,
                                      std::span<const PartReading> readings) const;
  // The edits that may reach the nodes of a window.
  std::vector<std::size_t> EditsAt(const geo::NodeGrid& node_grid, const NodeWindow& window) const;
  Result<void> EditPoints(std::span<const GeoPosition> points, HeightDatum datum, std::span<float> heights,
                          const std::stop_token& stop) const;
  // dem_read.cc.
  Result<std::vector<float>> PointsUnedited(std::span<const GeoPosition> points, HeightDatum datum,
                                            const std::stop_token& stop, std::span<std::uint8_t> filled = {}) const;
  HeightRange UneditedRange(const geo::Lattice& lattice, const geo::TileKey& key) const;
  // dem_edits.cc.
  HeightRange RangeOfReplacement(const Edit& edit, const geo::Lattice& lattice, const geo::TileKey& key) const;
  std::uint64_t ComputeEditsHash(const geo::TileKey& key) const;
  // The numbers of the edits that ask for precision on edges beyond a tile's corners.
  void AddPrecisionBeyondCorners(const geo::TileKey& key, std::set<std::size_t>& found) const;

  std::vector<RasterGrid> grids;  // in order of precedence
  BoxIndex index;                 // of the raster grids, by degrees (IndexOf)
  std::vector<geo::Lattice> lattices;
  std::vector<std::vector<geo::TileRange>> available;
  std::vector<std::vector<geo::TileRange>> ancestors_of_added;  // of the tiles that edits added; empty: none
  float floor = 0;                                              // metres above the ellipsoid
  // Undulations of the last raster grid that refers to a geoid, for the whole Earth. Null: no raster grid does.
  std::shared_ptr<const Undulations> floor_undulations;
  bool has_feather = false;
  DemInfo info;
  std::uint64_t fingerprint = 0;
  std::vector<GridContent> contents;  // by raster grid

  // Null: there are no edits.
  std::unique_ptr<const EditSet> edits;
  std::vector<std::unique_ptr<ElevationModel>> replacements;  // by Edit::replacement
  StampedFiles edit_files;
  std::uint64_t unedited_fingerprint = 0;
  HeightRange unedited_heights;  // `info.heights` without edits
  // Hashes by tile: hashing many edits takes longer than finding a cached tile.
  mutable std::mutex hashes_mutex;
  // Level, column, row; then for TileEdits::MercatorHash the window's columns and rows, for Hash 0, 0, for
  // DeeperTilesHash -1, -1.
  using HashKey = std::array<std::int64_t, 5>;
  struct HashOfKey {
    std::size_t operator()(const HashKey& key) const {
      std::uint64_t hash = 0;
      for (const std::int64_t value : key) hash = (hash ^ static_cast<std::uint64_t>(value)) * 0x9e3779b97f4a7c15;
      return hash ^ hash >> 32;
    }
  };
  mutable std::unordered_map<HashKey, std::uint64_t, HashOfKey> hashes;
  std::optional<std::uint64_t> KnownHash(const HashKey& key) const;
  void KeepHash(const HashKey& key, std::uint64_t hash) const;
};

// The PROJ operation of the geoid above which a source's heights are when they are read in a datum; empty: none.
std::string GeoidIn(HeightDatum datum, const VerticalDatum& source);

// A box around the nodes of a window. Its longitudes begin between -180 and 180 and continue eastwards.
Box BoxOf(const geo::NodeGrid& node_grid, const NodeWindow& window);

// An index of raster grids by the box in degrees where they may have heights. Each box is entered three
// times, 360 degrees apart, so that it is found with longitudes from -540 to 540.
BoxIndex IndexOf(const std::vector<RasterGrid>& grids);

}  // namespace terrace::dem

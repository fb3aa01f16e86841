// A digital elevation model as terrace sees it: heights at lattice nodes, anywhere on the globe, at any level. It is
// made of one raster or of many: a node takes the first source, by rank and resolution, that has a height there, and
// the floor where none has (docs/decisions/0010-mosaics.md).
//
// DemSource is immutable after Open and safe to use from many threads: every thread gets its own GDAL handle. GDAL's
// types stay behind this header.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/gdal/file_stamp.h"
#include "engine/geo/lattice.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

class DemSource {
 public:
  // Opens rasters, checks them, and scans each once for its heights. Errors name the file, what is wrong and the
  // remedy.
  static Result<std::unique_ptr<DemSource>> Open(std::vector<DemFile> files, const DemOptions& options = {});
  static Result<std::unique_ptr<DemSource>> Open(const std::string& path, const DemOptions& options = {});
  ~DemSource();

  const DemInfo& info() const;

  // Levels 0 .. max_level are served: the deepest is the first whose default error is at most a tenth of the finest
  // source's spacing, or at most `finest_error`.
  int max_level() const;
  geo::Lattice LatticeOf(int level) const;

  // Blocks of tiles, without overlap, sorted by row and column, that hold every tile of the level which touches a
  // source that is worth the level, and every ancestor of a tile; at level 0 both roots (availability.h).
  const std::vector<geo::TileRange>& Available(int level) const;
  // The same of all levels, from 0.
  const std::vector<std::vector<geo::TileRange>>& Availability() const;
  bool IsAvailable(const geo::TileKey& key) const;

  // Heights no sample of the tile (halo not included) leaves: at least as wide as the truth, a function of the key
  // alone. Any valid key; tiles away from the source hold only the floor.
  HeightRange RangeBound(const geo::TileKey& key) const;

  // Reads and resamples one tile. kUnavailable: the source cannot be read now.
  // kChanged: it is not the file that was opened any more. kCancelled: stopped.
  Result<TileHeights> Read(const geo::TileKey& key, std::stop_token stop = {}) const;

  // Heights of the same nodes as each source counts them: of those above the ellipsoid, and of unknown ones, the same.
  // For comparisons with a sea level; the floor counts as the last source that is above a geoid does.
  Result<TileHeights> ReadAsCounted(const geo::TileKey& key, std::stop_token stop = {}) const;

  // Heights at nodes of a level's lattice, row by row from the south-western one: the same bits as in its tiles. Any
  // level up to geo::kMaxLevel; columns count modulo 360 degrees; rows lie within the lattice.
  Result<std::vector<float>> ReadNodes(int level, const NodeWindow& window, std::stop_token stop = {}) const;

  // Heights at pixel centres of a Web Mercator grid, row by row from the north-western one, under the rules of tiles:
  // averaged to the grid's resolution, small voids filled, the floor elsewhere. A height is a function of depth and
  // pixel alone. Depths 0 .. geo::kMaxLevel; the first that is as fine as the source is info().max_mercator_depth.
  Result<std::vector<float>> ReadMercator(int depth, const NodeWindow& window, std::stop_token stop = {}) const;

  // Heights of the sources' full resolution, bilinear between samples, in the order of `points`; NaN outside the
  // sources, in collars, and in holes that are not smoothed over. Voids are filled as in tiles: `filled`, one for each
  // point or none, becomes 1 where the sample whose pixel holds the point is void. A height does not depend on the
  // other points. Precondition: finite longitudes, latitudes in -90 .. 90.
  Result<std::vector<float>> ReadPoints(std::span<const GeoPosition> points,
                                        HeightDatum datum = HeightDatum::kEllipsoid, std::stop_token stop = {},
                                        std::span<std::uint8_t> filled = {}) const;

  // Whether it is known what every source counts from: else there are no orthometric heights.
  bool has_datum() const;
  // Whether a source counts from a geoid: ReadAsCounted differs from Read.
  bool converts() const;

  // Since it was opened, in all threads; for metrics.
  SampleCounts CountSamples() const;

  // Identifies content and options: device, inode, size, mtime and ctime of all files in their order, and every option
  // that changes heights.
  std::uint64_t fingerprint() const;

  // What it is read from, as it was when it was opened.
  StampedFiles files() const;

 private:
  class Impl;
  explicit DemSource(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem

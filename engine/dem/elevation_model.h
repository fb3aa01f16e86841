// A digital elevation model: heights at lattice nodes, anywhere on the globe, at any level.
//
// A model has one or more rasters. Sources are ordered by rank and resolution; a node takes its height from the first
// source with a height there; with a feather it is blended with those of the sources below. Nodes without a source take
// the floor (docs/decisions/0010-mosaics.md).
//
// Immutable after Open. Thread-safe: each thread uses its own GDAL handle. No GDAL type appears in this header.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/gdal/file_stamp.h"
#include "engine/geo/lattice.h"
#include "engine/geo/tile_key.h"
#include "engine/sight/sight_ray.h"

namespace terrace::dem {

struct ContentHash;

class ElevationModel {
 public:
  // Opens and checks rasters. Their statistics come from DemOptions::cache, or else from a pass over all samples of the
  // raster. A raster that may have undeclared voids, or whose overviews mislead, takes several passes. Relative paths
  // are resolved at each use: the working directory must not change. The first call sets up GDAL for the whole process
  // (docs/embedding.md).
  //
  // Paths name files, not folders. To open a folder, pass its files, each with DemFile::skip_if_no_raster set.
  //
  // Errors name the file, the fault and the remedy. kNotFound: a file does not exist; a raster has no height; or, with
  // skip_if_no_raster, all files were skipped or none has a height. kInvalidArgument: an option, a reference system, a
  // raster or an edit that cannot be used, also if the edit's file or raster cannot be read. kUnavailable: a file
  // cannot be read. kChanged: it was replaced meanwhile. kCancelled: DemOptions::stop.
  static Result<std::unique_ptr<ElevationModel>> Open(std::vector<DemFile> files, const DemOptions& options = {});
  static Result<std::unique_ptr<ElevationModel>> Open(const std::string& path, const DemOptions& options = {});
  // Open, with the statistics of all files from the cache. Reads samples only for edits; the rasters of `replace` edits
  // are opened as by Open, which may take long. Errors: those of Open. kCancelled also means that the cache lacks
  // statistics of a file. If another file has an error of its own, that error is returned instead of kCancelled; but if
  // DemOptions::fault is set, fault gets that error, and kCancelled is returned.
  static Result<std::unique_ptr<ElevationModel>> OpenFromCache(std::vector<DemFile> files, const DemOptions& options);
  ~ElevationModel();

  const DemInfo& info() const;

  // The deepest level served: the first whose default error is at most `finest_error`; without that option, at most a
  // tenth of the finest source's spacing. Deeper, if an edit asks for more precision. At most geo::kMaxLevel.
  int max_level() const;
  // What max_level() would be if there were no edits. Deeper levels have tiles only around edits.
  int max_source_level() const;
  // Precondition: 0 .. geo::kMaxLevel.
  geo::Lattice LatticeOf(int level) const;

  // The available tiles of a level, as ranges without overlap, sorted by row and column: tiles that overlap the bounds,
  // in degrees, of a raster that is fine enough for the level; tiles that edits add, and tiles around them; the
  // ancestors of these, and the siblings of all of them. A level with too many ranges gets fewer and larger ones. So
  // some tiles lie outside all sources. Level 0 has both roots.
  const std::vector<geo::TileRange>& Available(int level) const;
  // Available() of all levels, from 0.
  const std::vector<std::vector<geo::TileRange>>& Availability() const;
  bool IsAvailable(const geo::TileKey& key) const;

  // A range that contains all heights of the tile's samples, without the halo, from the statistics alone. Accepts any
  // valid key; tiles that neither a source nor an edit reaches hold only the floor. May throw ThrownError.
  HeightRange RangeBound(const geo::TileKey& key) const;

  // Reads and resamples one tile. Heights are in metres above the WGS 84 ellipsoid. Precondition: a valid key.
  // kUnavailable: a source cannot be read now. kChanged: a file was replaced. kCancelled: stopped.
  Result<TileHeights> Read(const geo::TileKey& key, std::stop_token stop = {}) const;

  // The same nodes, with heights in each source's own vertical datum (HeightDatum::kSource). Use it to compare heights
  // with a sea level. `source_error_m` stays infinite. Precondition: a valid key. Errors: those of Read.
  Result<TileHeights> ReadInSourceDatum(const geo::TileKey& key, std::stop_token stop = {}) const;

  // Heights at nodes of a level's lattice, row by row from the south-western node. Bit-equal to the heights of tiles.
  // Levels 0 .. geo::kMaxLevel. Columns wrap at 360 degrees. Preconditions: the window is not empty, and its rows lie
  // within the lattice. Errors: those of Read.
  Result<std::vector<float>> ReadNodes(int level, const NodeWindow& window, std::stop_token stop = {}) const;

  // Heights at pixel centres of a Web Mercator grid, row by row from the north-western pixel. The rules of tiles apply:
  // samples are averaged to the grid's resolution, voids are filled as DemOptions says, and the floor is used
  // elsewhere. A height depends on depth and pixel alone. The grid has 256 << depth pixels around the Earth; depth is
  // 0 .. geo::kMaxLevel. info().max_mercator_depth is the first as fine as the finest source. Columns wrap at 360
  // degrees. Preconditions: the window is not empty, and its rows lie within the grid. Errors: those of Read.
  Result<std::vector<float>> ReadMercator(int depth, const NodeWindow& window, std::stop_token stop = {}) const;

  // The same pixels for maps: NaN instead of the floor where neither a source nor an edit has a height. Preconditions:
  // as above; `datum` is kEllipsoid or kSource. Maps that print heights, such as contours, use kSource. Errors: those
  // of Read.
  Result<std::vector<float>> ReadKnownMercator(int depth, const NodeWindow& window, HeightDatum datum,
                                               std::stop_token stop = {}) const;

  // Heights at the sources' full resolution, bilinear between samples and rounded to 2^-10 m, in the order of `points`.
  // NaN where no source has a height: outside the sources; in collars; in holes, with HoleFill::kFloor; and where the
  // geoid that a conversion needs has no value. At the poles, all longitudes have one height, as in tiles. Other voids
  // are filled as in tiles; a feather has no effect. `filled` has one element for each point, or none; an element is 1
  // if the sample nearest to the point is void in the source that gives the height, and 0 elsewhere. Edits apply: NaN
  // in holes that they cut. Where no source has a height, the height that an edit sets is returned if `datum` is
  // kEllipsoid, and NaN in other datums. A height does not depend on the other points. Preconditions: finite
  // longitudes, latitudes in -90 .. 90. Errors: those of Read. kInvalidArgument: kOrthometric needs EGM96, and PROJ
  // lacks its grid.
  Result<std::vector<float>> ReadPoints(std::span<const GeoPosition> points,
                                        HeightDatum datum = HeightDatum::kEllipsoid, std::stop_token stop = {},
                                        std::span<std::uint8_t> filled = {}) const;

  // Looks along rays over the surface of ReadPoints, but without edits and without rounding; one answer for each ray.
  // Heights of rays are above the ellipsoid. Precondition: finite positions on Earth, rays no longer than
  // kMaxSightLength. Errors: those of ReadPoints; kInvalidArgument: a ray passes above the box around an edit that
  // changes heights or cuts a hole. A ray that passes within 125 m of such a box may be refused, too.
  Result<std::vector<SightAnswer>> LookAlong(std::span<const SightRay> rays, const SightOptions& options,
                                             std::stop_token stop = {}) const;

  // Whether the vertical datum of every source is known. HeightDatum::kOrthometric leaves heights of an unknown datum
  // unchanged.
  bool has_datum() const;
  // Whether a source refers to a geoid, so that ReadInSourceDatum differs from Read.
  bool has_geoid() const;

  // Samples read since Open for nodes and pixels, not for points and rays, by all threads; without the rasters of
  // `replace` edits. For metrics.
  SampleCounts CountSamples() const;
  // Blocks that the process keeps now, of all models. For metrics.
  static KeptBlocks CountKeptBlocks();

  // A hash of everything that heights depend on: samples, positions and vertical datums of all sources in order of
  // precedence, and every option that changes heights. Copies of the files have the same hash.
  std::uint64_t fingerprint() const;
  // The same without edits.
  std::uint64_t unedited_fingerprint() const;

  // Whether the data of a source (not of an edit's raster) in the cache folder can no longer be read. Its tiles then
  // take longer until it is reopened.
  bool has_lost_cache() const;

  // The files of sources, of the geoid grids that they refer to, and of edits, with their stamps at Open. Grids of PROJ
  // that place rasters, and EGM96 if only edits need it, are not among them.
  StampedFiles files() const;

 private:
  class Impl;
  friend class TileEdits;                                                            // tile_edits.h
  friend ContentHash ContentBelow(const ElevationModel&, const geo::TileKey&, int);  // content_below.h
  explicit ElevationModel(std::unique_ptr<Impl> impl);
  static Result<std::unique_ptr<ElevationModel>> OpenAs(std::vector<DemFile> files, const DemOptions& options,
                                                        bool only_cached);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem

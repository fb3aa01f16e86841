// A digital elevation model: heights at lattice nodes, anywhere on the globe, at any level.
//
// A model has one or more rasters, its sources. A node takes its height from the first source, in order of precedence
// (DemFile::rank), that has one there. A feather blends it with the heights of the next sources (DemOptions::feather).
// A node without a height has the floor (DemOptions::floor).
//
// A model does not change after Open. Thread-safe: each thread uses its own GDAL handle.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/lattice.h"
#include "engine/geo/tile_key.h"
#include "engine/sight/sight_ray.h"

namespace terrace::dem {

struct ContentHash;
class StampedFiles;  // engine/gdal/stamped_files.h, which is not installed

class ElevationModel {
 public:
  // Opens and checks rasters. Takes their statistics from DemOptions::cache. Where it has none, reads all samples of
  // the raster, some rasters several times. `files` are files, not folders. Relative paths are resolved at each use, so
  // the working directory must not change. The first call sets up GDAL for the whole process (docs/embedding.md).
  //
  // Errors; the message names the file, the fault and the remedy:
  // - kNotFound: a file does not exist; a raster without skip_if_no_raster has no height; all files were skipped, or
  //   none has a height.
  // - kInvalidArgument: an option, a reference system, a raster or an edit cannot be used, or an edit's GeoJSON file or
  //   raster cannot be read.
  // - kUnavailable: a file of a source cannot be read now.
  // - kChanged: a file was replaced meanwhile.
  // - kCancelled: DemOptions::stop was requested.
  static Result<std::unique_ptr<ElevationModel>> Open(std::vector<DemFile> files, const DemOptions& options = {});
  static Result<std::unique_ptr<ElevationModel>> Open(const std::string& path, const DemOptions& options = {});
  // Like Open, but returns kCancelled if the cache lacks statistics of a file, so it seldom takes long. If another file
  // has an error besides: without DemOptions::fault, that error is returned; with it, `fault` gets the error, and
  // kCancelled is returned. The rasters of `replace` edits (docs/edits.md) are opened as by Open.
  static Result<std::unique_ptr<ElevationModel>> OpenFromCache(std::vector<DemFile> files, const DemOptions& options);
  ~ElevationModel();

  const DemInfo& info() const;

  // The deepest level that has tiles, at most geo::kMaxLevel. Without edits, it is the first level whose default error
  // (geo::DefaultError) is at most DemOptions::finest_error. If finest_error is not set, it is the first level whose
  // default error is at most a tenth of the finest source's spacing. Edits that ask for more precision add levels.
  int max_level() const;
  // What max_level() would be without edits. Deeper levels have tiles only around edits.
  int max_source_level() const;
  // Precondition: 0 .. geo::kMaxLevel.
  geo::Lattice LatticeOf(int level) const;

  // The available tiles of a level: ranges that do not overlap, sorted by row and column. Available are:
  // - tiles that overlap the bounds of a raster, in degrees, if the raster is fine enough for the level
  // - tiles that edits add, and tiles around them: on each side of such a tile is a tile of its level or of the next
  //   shallower one
  // - the ancestors of all these tiles
  // - the siblings of all these tiles and ancestors
  // - both tiles of level 0
  // A level with too many ranges gets fewer and larger ones. So some available tiles lie outside all sources.
  const std::vector<geo::TileRange>& Available(int level) const;
  // Available() of all levels, from 0.
  const std::vector<std::vector<geo::TileRange>>& Availability() const;
  bool IsAvailable(const geo::TileKey& key) const;

  // A range that contains all heights of the tile's samples, without the halo (TileHeights). Computed from statistics,
  // not from samples. Statistics that are not in memory are read from the cache folder, or computed again. If the tile
  // has neither a source nor an edit, the range is the floor. Precondition: a valid key. May throw ThrownError.
  HeightRange RangeBound(const geo::TileKey& key) const;

  // Reads and resamples one tile. Heights are in metres above the WGS 84 ellipsoid. Precondition: a valid key.
  // kUnavailable: a source cannot be read now. kChanged: a file was replaced. kCancelled: `stop` was requested.
  Result<TileHeights> Read(const geo::TileKey& key, std::stop_token stop = {}) const;

  // Like Read, with heights in each source's own vertical datum (HeightDatum::kSource), to compare them with a sea
  // level. TileHeights::source_error_m is infinite.
  Result<TileHeights> ReadInSourceDatum(const geo::TileKey& key, std::stop_token stop = {}) const;

  // Heights at nodes of a level's lattice (LatticeOf), row by row from the south-western node: the heights that tiles
  // have there, bit for bit. Columns wrap at 360 degrees. Preconditions: a level of 0 .. geo::kMaxLevel; the window is
  // not empty, and its rows lie in the lattice. Errors: those of Read.
  Result<std::vector<float>> ReadNodes(int level, const NodeWindow& window, std::stop_token stop = {}) const;

  // Heights at pixel centres of a Web Mercator grid, row by row from the north-western pixel. The grid has 256 << depth
  // pixels around the Earth. A height depends on depth and pixel alone, and is made like those of tiles: averages of
  // samples if the sources are finer than the grid, filled voids, the floor. Columns wrap at 360 degrees.
  // Preconditions: a depth of 0 .. geo::kMaxLevel; the window is not empty, and its rows lie in the grid. Errors: those
  // of Read. DemInfo::max_mercator_depth is the first depth as fine as the finest source.
  Result<std::vector<float>> ReadMercator(int depth, const NodeWindow& window, std::stop_token stop = {}) const;

  // Like ReadMercator, but NaN instead of the floor. Precondition: `datum` is kEllipsoid, or kSource for maps that
  // print heights, such as contours.
  Result<std::vector<float>> ReadKnownMercator(int depth, const NodeWindow& window, HeightDatum datum,
                                               std::stop_token stop = {}) const;

  // Heights at the sources' full resolution: bilinear between samples, rounded to 2^-10 m, in the order of `points`. A
  // height does not depend on the other points. At the poles, all longitudes have one height, as in tiles. Voids are
  // filled as in tiles; a feather has no effect. Edits apply. NaN:
  // - in holes that edits cut
  // - where no source has a height, unless an edit sets it and `datum` is kEllipsoid
  // A source has no height outside its rasters, in its collars, in its holes with HoleFill::kFloor, and where the geoid
  // that a conversion needs has no value. `filled` is empty or has one element for each point. An element is set to 1
  // if the sample nearest to the point is void in the source that gives the height, else to 0. Preconditions: finite
  // longitudes, latitudes in -90 .. 90. Errors: those of Read; kInvalidArgument: kOrthometric needs EGM96, and PROJ
  // lacks its grid.
  Result<std::vector<float>> ReadPoints(std::span<const GeoPosition> points,
                                        HeightDatum datum = HeightDatum::kEllipsoid, std::stop_token stop = {},
                                        std::span<std::uint8_t> filled = {}) const;

  // Lines of sight over the surface of ReadPoints, without edits and without rounding; one answer for each ray. Heights
  // of rays are above the ellipsoid. Preconditions: finite positions on Earth; rays no longer than kMaxSightLength.
  // Errors: those of ReadPoints; kInvalidArgument: a ray crosses, in longitude and latitude, the box around an edit
  // that changes heights or cuts a hole. A ray that passes within 125 m of the box may also be refused.
  Result<std::vector<SightAnswer>> LookAlong(std::span<const SightRay> rays, const SightOptions& options,
                                             std::stop_token stop = {}) const;

  // Whether the vertical datum of every source is known. Heights of a source with an unknown datum are the same in
  // every HeightDatum.
  bool has_datum() const;
  // Whether a source refers to a geoid, so that ReadInSourceDatum differs from Read.
  bool has_geoid() const;

  // Samples read since Open, by all threads. Reads of points and rays, and of the rasters of `replace` edits, do not
  // count. For metrics.
  SampleCounts CountSamples() const;
  // Blocks that the process keeps now, of all models. For metrics.
  static KeptBlocks CountKeptBlocks();

  // A hash of all that heights depend on: samples, positions and vertical datums of the sources, edits, and options.
  // Copies of the files have the same hash.
  std::uint64_t fingerprint() const;
  // The same without edits.
  std::uint64_t unedited_fingerprint() const;

  // Whether the statistics or averages of a source can no longer be read from the cache folder. Its tiles then take
  // longer, until the model is opened again.
  bool has_lost_cache() const;

  // The files of sources, of their geoid grids and of edits, with their stamps at Open. Grids of PROJ that place
  // rasters are not among them, nor is EGM96 if only edits need it.
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

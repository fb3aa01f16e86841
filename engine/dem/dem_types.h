// Plain values that elevation models are described with: options, files, extents, heights of tiles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/geo/lattice.h"

namespace terrace::dem {

// How the samples of a source are to be understood.
struct SourceOptions {
  // What its heights count from: "crs" (what its reference system states), "unknown", "ellipsoid", "egm96", "egm2008",
  // a vertical reference system ("EPSG:5703"), or the path of a grid of undulations.
  std::string vertical = "crs";
  bool find_voids = true;           // detects undeclared nodata values (undeclared_nodata.h)
  std::vector<double> nodata = {};  // raw values that are voids, beside the declared one

  friend bool operator==(const SourceOptions&, const SourceOptions&) = default;
};

// What is drawn in a hole, a large void with data all around it, where no source has a height. Voids that touch the rim
// of their source are collars, and show the floor in any case (docs/decisions/0015-voids.md).
enum class HoleFill : std::uint8_t {
  kSmooth,  // a smooth surface between the heights around it
  kFloor,
};

// What heights are to count from.
enum class HeightDatum : std::uint8_t {
  kEllipsoid,    // that of WGS 84, as in tiles
  kOrthometric,  // the geoid that the source counts from; EGM96 where it counts from the ellipsoid
  kSource,       // that of the source's samples
};

struct DemOptions {
  SourceOptions source = {};    // of files that have none of their own
  double error_fraction = 0.5;  // default error of a level, as a share of the clients' level error
  std::optional<double> finest_error =
      {};                            // metres: the deepest level is the first whose default error is at most this
  std::optional<double> floor = {};  // metres above the ellipsoid, outside the source and in collars; default: the
                                     // lowest height, at most
  HoleFill voids = HoleFill::kSmooth;
  int max_void_gap = 64;  // source samples: voids narrower than this along a row, column or diagonal are filled
  // A folder for what is learnt of sources once (docs/configuration.md). Empty: nothing is kept.
  std::string cache_dir = {};
  // Metres, of a mosaic: so far from its edges and voids a source begins to give way to what lies below it. 0: at them.
  double feather = 0;
  // Called now and then while Open scans the sources, with the share done, 0..1: files count alike. May be empty.
  std::function<void(double)> progress = {};
  std::stop_token stop = {};  // Open gives up (kCancelled)
  // Told of every file that cannot be opened, after which Open looks at the others too before it fails. Empty: it fails
  // at the first.
  std::function<void(const Error&)> fault = {};
};

// One raster of a dataset.
struct DemFile {
  std::string path;
  // Where several sources have a height the one of the lowest rank counts; of equal ranks the finer one, then the one
  // whose path sorts first.
  int rank = 0;
  bool may_be_other = false;                  // it stands in a folder: if it is no raster at all it is left out
  std::optional<SourceOptions> options = {};  // of this file; else those of DemOptions
};

// Metres above the ellipsoid (or whatever the source counts from where no datum is stated).
struct HeightRange {
  double min = 0;
  double max = 0;
};

// Degrees. west > east: the box crosses the antimeridian.
struct GeoBounds {
  double west = -180, south = -90, east = 180, north = 90;
};

// Degrees.
struct GeoPosition {
  double longitude = 0, latitude = 0;
};

// A block of a grid of nodes: first column and row, and how many of each.
struct NodeWindow {
  std::int64_t column = 0, row = 0;
  int columns = 0, rows = 0;
};

// What `terrace info` prints of one raster.
struct RasterInfo {
  std::string path;
  std::string driver;  // GDAL's short name: "GTiff"
  std::int64_t width = 0, height = 0;
  std::string data_type;                     // "Int16"
  std::string crs;                           // name and code: "WGS 84 / UTM zone 11N (EPSG:32611)"
  std::string vertical_datum;                // as stated by the CRS; empty: not stated
  std::string counts_from;                   // what heights are taken to count from; empty: not known
  std::string vertical_operation;            // the PROJ operation that makes them ellipsoidal; empty: none needed
  std::string height_unit;                   // as stated by the band; empty: metres assumed
  bool knows_height_unit = true;             // else heights are taken as metres
  std::string picture_part;                  // what of a picture the band says it is, "red"; empty: of none
  double pixel_width = 0, pixel_height = 0;  // in units of the CRS
  std::string pixel_unit;                    // "degree", "metre"
  double spacing_m = 0;                      // finer ground axis at the centre, true metres
  GeoBounds bounds;                          // of the pixels' area
  HeightRange heights;                       // of all valid samples, as the source counts them
  std::string heights_doubted;               // why they are hardly metres, with a way out; empty: they may be
  HeightRange ellipsoidal;                   // at least as wide as they are once converted
  std::uint64_t valid_samples = 0, void_samples = 0;
  std::uint64_t hole_samples = 0;  // of the voids, those that do not touch its rim
  std::optional<double> nodata;
  std::string found_voids;  // what find_voids found, for people; empty: nothing
  std::vector<int> overview_factors;
  std::string overviews_unused;  // why those that it has are not, with a way out; empty: they are, or there are none
  std::string transform;         // the PROJ operation from EPSG:4326 to the source, for the log; empty: none needed
  bool needs_averages = false;   // large, and without overviews
  bool prepared = false;         // it has averages in the cache folder
  double seconds_to_open = 0;
};

// What `terrace info` prints and `/datasets` tells of a dataset.
struct DemInfo {
  std::vector<RasterInfo> sources;  // sorted: the first that has a height at a place gives it
  GeoBounds bounds;
  HeightRange heights;  // above the ellipsoid, at least as wide as those of all valid samples
  double floor = 0;
  int max_level = 0;
  int max_mercator_depth = 1;
  // Files of folders that have no part in it though they look like rasters, each with the reason.
  std::vector<std::string> left_out;
};

// Samples read for tiles, at the resolution they were read at.
struct SampleCounts {
  std::uint64_t measured = 0;
  std::uint64_t filled = 0;  // voids, from the heights around them
  std::uint64_t voids = 0;   // other sources or the floor show there
};

// Height samples of a tile with one more sample on each side, row by row from the south-western halo sample. Every
// value is finite. The same global node has the same bits in every tile.
struct TileHeights {
  geo::Lattice lattice;
  int stride = 0;              // cells + 3
  std::vector<float> heights;  // stride * stride
  // Metres, of Read alone: no valid sample of a source, at its full resolution and above the ellipsoid, lies farther
  // from the surface that is bilinear between the tile's own samples; nor does what sources are blended to, where a
  // feather blends them. The halo does not count.
  double source_error_m = std::numeric_limits<double>::infinity();

  // i, j in -1 .. cells + 1: columns from the west, rows from the SOUTH.
  float At(int i, int j) const {
    return heights[static_cast<std::size_t>(j + 1) * static_cast<std::size_t>(stride) +
                   static_cast<std::size_t>(i + 1)];
  }
};

}  // namespace terrace::dem

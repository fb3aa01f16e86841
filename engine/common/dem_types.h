// Plain values of elevation models: options, files, extents, heights of tiles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/geo/geo_bounds.h"
#include "engine/geo/lattice.h"

namespace terrace::dem {

// How to interpret the samples of a source.
struct SourceOptions {
  // The vertical datum. "crs": as the file states it; if it states none, as "unknown". "unknown": heights are used
  // unchanged, with a warning. Others: "ellipsoid", "egm96", "egm2008", the EPSG code of a vertical reference system
  // ("EPSG:5703"), the path of a geoid grid.
  std::string vertical = "crs";
  bool find_voids = true;           // detects undeclared nodata values
  std::vector<double> nodata = {};  // further raw values that mean void

  friend bool operator==(const SourceOptions&, const SourceOptions&) = default;
};

// Voids narrower than DemOptions::max_void_gap are filled from their edges. Wider voids are of two kinds. A collar
// touches the rim of its raster or, if rasters are read as one (DemFile::rank), a pixel that none of them has. A hole
// has data all around it. Where no source has a height, a collar has the floor, and a hole has what this option says
// (docs/decisions/0015-voids.md).
enum class HoleFill : std::uint8_t {
  // A harmonic surface between the surrounding heights. If a raster's voids are too ragged to tell holes from collars,
  // all are collars, and RasterInfo::warnings says so.
  kSmooth,
  kFloor,
};

// The vertical datum of the heights that a read returns. Heights that edits set may change by millimetres when they are
// converted (docs/edits.md).
enum class HeightDatum : std::uint8_t {
  kEllipsoid,    // the WGS 84 ellipsoid, as in tiles
  kOrthometric,  // the source's geoid; EGM96 where the source refers to the ellipsoid
  // The source's own. The floor is in the datum of the last source, in order of precedence, that has a geoid; if no
  // source has one, it is above the ellipsoid.
  kSource,
};

class AveragesBudget;  // engine/common/averages_budget.h
class CacheFolder;     // engine/statistics/cache_folder.h

// Where models keep statistics of rasters, and averages of blocks of samples, from which tiles of low levels are read.
// With a folder, later calls of Open need not read all samples of a raster again, as long as its files and the options
// do not change.
struct RasterCache {
  std::shared_ptr<CacheFolder> folder = {};     // null: none
  std::shared_ptr<AveragesBudget> memory = {};  // for averages that the folder does not keep; null: none
};

struct DemOptions {
  SourceOptions source = {};    // for files without options of their own, and for the rasters of edits
  double error_fraction = 0.5;  // > 0: ratio of a level's default error to geo::LevelError
  // Metres, > 0: the deepest level is the first whose default error is at most this (ElevationModel::max_level).
  std::optional<double> finest_error = {};
  // Metres above the ellipsoid, -99,998 .. 99,998: the height where there is no other, which is outside the sources, in
  // collars, and in holes with HoleFill::kFloor. Default: DemInfo::heights.min without edits.
  std::optional<double> floor = {};
  HoleFill holes = HoleFill::kSmooth;
  int max_void_gap = 64;  // samples, 0 .. 4096: voids narrower than this along a row, column or diagonal are filled
  RasterCache cache = {};
  // GeoJSON files (docs/edits.md), in order. Later edits apply over earlier ones, but do not close holes that earlier
  // ones cut.
  std::vector<std::string> edits = {};
  // Metres, 0 .. 10^6; 0: none. Within this distance of its edges and voids, a source is blended with the next sources
  // in order of precedence. On each level, the distance is at most 256 times the spacing of the samples, or averages,
  // that the level is read from.
  double feather = 0;
  // Called by Open on its threads, one call at a time, with the share done, 0 .. 1. All files have equal shares. The
  // share falls if a raster has to be read again.
  std::function<void(double)> progress = {};
  std::stop_token stop = {};  // makes Open return kCancelled
  // Called on the thread of Open for each file that cannot be opened, after all files were tried. Open then returns the
  // error of the first of them in the list. Empty: Open ends at the first error.
  std::function<void(const Error&)> fault = {};
};

// How the bytes of files are hashed for fingerprints.
struct FileContentOptions {
  std::string cache_dir = {};  // folder that stores the hashes of large files; empty: none
  std::stop_token stop = {};
};

// One raster of a dataset.
struct DemFile {
  std::string path;
  // Order of precedence: the lowest rank, then the finer source (spacings are rounded to powers of 2^(1/16)), then the
  // path that sorts first. Rasters of one rank and one vertical datum that touch on one pixel grid are read as one
  // raster. Its place in this order is that of its first member. DemInfo::sources lists the members one by one. The
  // order of the list of files has no effect.
  int rank = 0;
  // For files of a folder: a file that is no raster is skipped, and one without any height is no error.
  bool skip_if_no_raster = false;
  std::optional<SourceOptions> options = {};  // default: DemOptions::source
};

// Metres above the ellipsoid, unless the member says otherwise. Heights of a source with an unknown vertical datum are
// as the source has them.
struct HeightRange {
  double min = 0;
  double max = 0;
};

using geo::GeoBounds;

// Degrees.
struct GeoPosition {
  double longitude = 0, latitude = 0;
};

// A rectangle of nodes of a lattice, whose rows count northwards, or of pixels of a Web Mercator grid, whose rows count
// southwards.
struct NodeWindow {
  std::int64_t column = 0, row = 0;  // the first
  int columns = 0, rows = 0;
};

// The number of elements in `rows` rows of `columns` elements.
constexpr std::size_t Area(std::int64_t columns, std::int64_t rows) {
  return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
}

// The index of an element in rows of `columns` elements.
constexpr std::size_t IndexAt(std::int64_t column, std::int64_t row, std::int64_t columns) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
}

// The remainder in 0 .. modulus - 1, for example of columns around the Earth.
constexpr std::int64_t FloorMod(std::int64_t value, std::int64_t modulus) {
  return (value % modulus + modulus) % modulus;
}

// What is known of one raster, for `terrace info` and the log.
struct RasterInfo {
  std::string path;
  std::string driver;  // GDAL's short name: "GTiff"
  std::int64_t width = 0, height = 0;
  std::string data_type;           // "Int16"
  std::string crs;                 // name and code: "WGS 84 / UTM zone 11N (EPSG:32611)"
  std::string vertical_datum;      // as stated by the CRS; empty: not stated
  std::string datum_in_use;        // the vertical datum in use; empty: unknown
  std::string vertical_operation;  // PROJ operation to ellipsoidal heights; empty: none needed
  std::string height_unit;         // as stated by the band; empty: none, metres assumed
  bool knows_height_unit = true;   // false: the stated unit is not known, metres assumed
  // GDAL's colour interpretation of the band, "Red", if it suggests a picture and not heights; empty: it does not.
  std::string picture_color;
  double pixel_width = 0, pixel_height = 0;  // in units of the CRS
  std::string pixel_unit;                    // "degree", "metre"
  double spacing_m = 0;                      // along the finer axis at the centre, metres on the ground
  GeoBounds bounds;                          // of the pixels' area
  HeightRange heights;                       // of all valid samples, in the source's datum; 0 if all are voids
  std::string heights_doubted;               // why they may not be metres, with the remedy; empty: plausible
  HeightRange ellipsoidal;                   // contains all ellipsoidal heights
  std::uint64_t valid_samples = 0, void_samples = 0;
  // Samples of voids with data all around them; also 0 if the voids are too ragged to tell.
  std::uint64_t enclosed_samples = 0;
  std::optional<double> nodata;       // raw value that the file declares, or that its type implies
  std::string found_voids;            // detected nodata values, for people; empty: none
  std::vector<int> overview_factors;  // of the overviews that are read
  std::vector<std::string> warnings;  // what else people should know, each with the remedy
  std::string overviews_unused;       // why the file's overviews are not read, with the remedy; may be empty
  // Why the pass over all samples decodes blocks many times, with the remedy; empty: it does not.
  std::string blocks_too_wide;
  std::string transform;  // PROJ operation from EPSG:4326 to the source, for the log; empty: none needed
  // Each of the finest stored averages covers N x N samples; this is N. 0: none are stored.
  int min_kept_factor = 0;
  bool has_averages_in_cache_folder = false;  // false: in memory, or none are stored
};

// A dataset, as `terrace info` prints it; `/datasets` returns a part of it.
struct DemInfo {
  std::vector<RasterInfo> sources;  // in order of precedence
  GeoBounds bounds;
  HeightRange heights;  // contains all valid samples and edited heights, metres above the ellipsoid
  double floor = 0;     // metres above the ellipsoid
  int max_level = 0;
  int max_source_level = 0;  // what max_level would be without edits, which may add levels
  // The first depth, at least 1, whose Web Mercator grid (256 << depth pixels around the Earth) is as fine as the
  // finest source.
  int max_mercator_depth = 1;
  std::size_t edits = 0;  // features
  // Files of folders that look like rasters and are not used, each with the reason.
  std::vector<std::string> left_out;
};

// The blocks of samples that the process keeps for points and lines of sight, for all sources.
struct KeptBlocks {
  std::size_t count = 0, bytes = 0;
};

// How many samples were read for nodes and pixels. A sample of an overview, or an average, counts as one. So does a
// void that is known from statistics and therefore not read.
struct SampleCounts {
  std::uint64_t measured = 0;
  std::uint64_t filled = 0;  // voids filled from the heights around them
  std::uint64_t voids = 0;   // not filled
};

// Height samples of a tile and a halo of one sample on each side, row by row from the south-western halo sample. All
// values are finite. A lattice node that several tiles share has the same height in each, bit for bit.
struct TileHeights {
  geo::Lattice lattice;
  int stride = 0;              // cells + 3
  std::vector<float> heights;  // stride * stride
  // Metres: an upper bound of the vertical distance between two things: the surface that is bilinear between the tile's
  // samples without the halo, and every valid sample of the sources at full resolution, with the edits that apply to
  // that sample. Where sources overlap, samples that a source earlier in order of precedence hides do not count. Where
  // sources are blended, the bound also holds for the blended heights. Infinite: no bound is known.
  double source_error_m = std::numeric_limits<double>::infinity();

  // i, j in -1 .. cells + 1: columns from the west, rows from the SOUTH.
  float At(int i, int j) const { return heights[IndexAt(i + 1, j + 1, stride)]; }
};

}  // namespace terrace::dem

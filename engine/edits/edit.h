// One edit of the terrain: a feature of a GeoJSON file (docs/edits.md).
#pragma once

#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/common/content_hash.h"
#include "engine/common/dem_types.h"

namespace terrace::dem {

enum class EditOp : std::uint8_t {
  kFlatten,    // one height
  kSlope,      // a plane, or triangles between the corners
  kOffset,     // adds metres
  kReplace,    // heights of another source
  kCarve,      // lowers to a line's profile
  kRaise,      // raises to a line's profile
  kPrecision,  // a smaller error
  kBreakline,  // nodes that are vertices
  kHole,       // no triangles
};
inline constexpr std::array<const char*, 9> kEditOpNames = {"flatten", "slope",     "offset",    "replace", "carve",
                                                            "raise",   "precision", "breakline", "hole"};
inline const char* NameOf(EditOp op) { return kEditOpNames[static_cast<std::size_t>(op)]; }

// The height of a flatten.
enum class FlatHeight : std::uint8_t { kGiven, kMean, kMedian };

// The reference of an edit's heights.
enum class EditDatum : std::uint8_t {
  kNone,        // not stated: the ellipsoid
  kEllipsoid,   // of WGS 84
  kOrthometric  // the geoid of the sources; EGM96 where they refer to the ellipsoid
};

// Metres east and north of the origin of an edit's plane.
struct PlanPoint {
  double x = 0, y = 0;
};

// A plane that touches the Earth at an edit: longitudes and latitudes are scaled by constants, so that lines that are
// straight in degrees are straight in it.
struct EditPlane {
  double longitude = 0, latitude = 0;  // of the origin, degrees; longitude in -180 .. 180
  double east_m = 1, north_m = 1;      // per degree

  double X(double lon) const;  // the shorter way around the Earth
  double Y(double lat) const { return (lat - latitude) * north_m; }
};

// Heights of a geoid above the ellipsoid around an edit, bilinear between nodes on its plane.
struct EditUndulations {
  PlanPoint south_west;
  double step_x = 1, step_y = 1;  // metres
  std::size_t columns = 0, rows = 0;
  std::vector<double> values;  // row by row from the south-western one

  double At(PlanPoint point) const;  // beyond the patch: that of its nearest point
};

struct Edit {
  EditOp op = EditOp::kFlatten;
  std::string file;         // as configured
  std::size_t feature = 0;  // its index in the file, from 0
  bool is_area = true;      // polygons; else lines

  EditPlane plane;
  // Lines, or closed rings of polygons without the repeated first point. A point is inside if an odd number of rings
  // encloses it. `heights`: of the points, for slope, carve and raise; else empty.
  std::vector<std::vector<PlanPoint>> rings;
  std::vector<std::vector<double>> heights;
  // For slope: triangles between corners of the first ring. Empty: the plane h = gradient . (x, y) + level.
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::array<double, 3> slope{};  // gradient along x and y, height at the origin

  double blend_m = 0;
  double half_width_m = 0;  // of lines
  FlatHeight flat = FlatHeight::kGiven;
  double height_m = 0;                 // of flatten
  EditDatum datum = EditDatum::kNone;  // of flatten, slope, carve and raise
  // Added to orthometric heights. Null until the sources are known, and for heights above the ellipsoid.
  std::shared_ptr<const EditUndulations> undulations;
  // Whether HeightDatum::kSource (or kOrthometric) is, everywhere within the edit's reach, the datum in which the edit
  // or its replacement states heights. ElevationModel sets it.
  bool is_in_source_datum = false, is_in_orthometric = false;
  double offset_m = 0;                                       // of offset
  double error_m = std::numeric_limits<double>::infinity();  // of precision
  double factor = 1;                                         // of precision: share of the tile's error, 0 .. 1
  int min_level = 0;                                         // of precision
  std::string source;                                        // of replace: a path
  std::string source_vertical;  // of replace: SourceOptions::vertical; empty: that of DemOptions::source
  std::size_t replacement = 0;  // of replace: index of the model opened from `source`; ElevationModel sets it

  // Derived by Complete.
  Box reach;                     // degrees, with the blend; around plane.longitude, so that its ends may be beyond 180
  double low_m = 0, high_m = 0;  // of the target heights
  double steepest = 0;           // of the target heights, metres per metre
  bool is_convex = false;
  // Edges of the outline by bands in y, so that a row scans few of them; without those that two rings share. Band b
  // begins at y = bands_from + b / bands_per_m. The edges within reach of it are band_edges[i] for band_begins[b] <= i
  // < band_begins[b + 1], in the order of rings and edges.
  struct EdgeNumber {
    std::uint32_t ring, edge;
    friend auto operator<=>(const EdgeNumber&, const EdgeNumber&) = default;
  };
  double bands_from = 0, bands_per_m = 0;
  std::vector<std::size_t> band_begins;
  std::vector<EdgeNumber> band_edges;
  ContentHash hash;

  double reach_m() const { return half_width_m + blend_m; }
  bool has_heights() const {
    return op == EditOp::kFlatten || op == EditOp::kSlope || op == EditOp::kCarve || op == EditOp::kRaise;
  }
  bool changes_heights() const { return op <= EditOp::kRaise; }
  // The datum in which the target is computed when heights in `of_heights` are edited: `of_heights` itself if the edit
  // is stated in it throughout its reach. Else the ellipsoid; the caller then converts the target to `of_heights`.
  HeightDatum TargetDatum(HeightDatum of_heights) const {
    const bool is_same = op == EditOp::kOffset || (of_heights == HeightDatum::kSource && is_in_source_datum) ||
                         (of_heights == HeightDatum::kOrthometric && is_in_orthometric);
    return is_same ? of_heights : HeightDatum::kEllipsoid;
  }
  // The weight of an edit at a distance from its polygon or its line: 1 inside, 0 beyond the blend.
  double WeightAt(double distance_m) const {
    const double beyond = distance_m - half_width_m;
    if (beyond <= 0) return 1;
    if (beyond >= blend_m) return 0;
    const double t = 1 - beyond / blend_m;
    return t * t * (3 - 2 * t);
  }
};

// Sets what is derived from the other members, after they have changed.
void Complete(Edit& edit);

}  // namespace terrace::dem

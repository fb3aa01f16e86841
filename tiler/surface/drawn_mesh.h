// The surface that a client draws for one tile: flat triangles in space, and heights and normals of the surface along
// plumb lines. The plumb line of a position is the ellipsoid's normal there.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/tile_key.h"

namespace terrace::tiler {

// A tile as a client decodes it, without skirts.
struct DrawnTriangles {
  std::vector<geo::Vec3> positions;           // ECEF metres
  std::vector<std::array<double, 2>> places;  // of the positions in the tile: 0 west .. 1 east, 0 south .. 1 north
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise from outside
  // By triangle, 1: in a hole that an edit cuts, clients do not draw it. Empty: they draw all.
  std::vector<std::uint8_t> in_hole;
  bool holes_are_left_out = false;  // true: where the tile has no triangle, an edit has cut a hole
};

struct DrawnPoint {
  double height_m = 0;     // above the ellipsoid, along the plumb line; NaN in a hole that an edit cuts
  geo::Vec3 normal;        // of the triangle: unit, ECEF, upwards; NaN in a hole that an edit cuts
  bool is_beside = false;  // the plumb line meets no triangle, and the place is not known to be in such a hole
};

// Immutable and thread-safe.
class DrawnMesh {
 public:
  DrawnMesh(const geo::TileKey& key, DrawnTriangles triangles);

  // Where the plumb line meets a triangle of the position's bucket; of several, the one that it meets farthest inside.
  // Nothing: it meets none, which is rare except near the tile's edge.
  std::optional<DrawnPoint> InOwnBucket(const dem::GeoPosition& point) const;
  // The same in the buckets around; on shallow levels among all triangles. A plumb line beside the mesh has the height
  // of the nearest point of the nearest triangle. Such lines exist because a tile's northern and southern edges are
  // parallels, and triangles end at chords of them. In the northern hemisphere chords lie beyond the northern edge, and
  // leave out a strip at the southern edge. Near a pole, triangles of tiles with coarse positions are steep slivers.
  DrawnPoint Nearest(const dem::GeoPosition& point) const;

  // A part of the tile, and the triangles that may lie over it.
  struct Bucket {
    double west, south, east, north;  // degrees
    std::span<const std::uint32_t> triangles;
  };
  Bucket BucketAt(const dem::GeoPosition& point) const;

  // Barycentric coordinates: a point this far outside counts as inside, so that no point falls between two triangles.
  static constexpr double kSlack = 1e-8;

  // Where a plumb line meets the plane of a triangle; nothing if the triangle is seen on edge, or narrower than a tenth
  // of a micrometre.
  struct Crossing {
    std::array<double, 3> inside;  // barycentric coordinates
    double height_m;               // above the ellipsoid
  };
  std::optional<Crossing> CrossingOf(std::uint32_t triangle, const dem::GeoPosition& point) const;

  bool IsInHole(std::uint32_t triangle) const { return !in_hole_.empty() && in_hole_[triangle] != 0; }

  const geo::TileKey& key() const { return key_; }
  std::size_t bytes() const;

  // Whether a point is farther from the tile's northern and southern edge than any chord of these parallels is.
  bool IsFarFromParallels(const dem::GeoPosition& point) const;

 private:
  struct Meeting;
  struct PlumbLine;
  void FillBuckets(const std::vector<std::array<double, 2>>& places);
  std::array<double, 2> PlaceOf(const dem::GeoPosition& point) const;
  PlumbLine LineAt(const dem::GeoPosition& point) const;
  std::optional<Crossing> Cross(const PlumbLine& line, std::uint32_t triangle) const;
  void Meet(const PlumbLine& line, std::uint32_t triangle, Meeting& best) const;
  DrawnPoint PointOf(const Meeting& met) const;

  geo::TileKey key_;
  geo::Vec3 origin_;
  std::vector<geo::Vec3> positions_;  // from the origin
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::uint8_t> in_hole_;  // as in DrawnTriangles
  bool holes_are_left_out_ = false;
  int side_ = 1;                              // buckets along an edge
  std::vector<std::uint32_t> bucket_starts_;  // side * side + 1
  std::vector<std::uint32_t> bucket_triangles_;
};

inline std::size_t BytesOf(const DrawnMesh& mesh) { return mesh.bytes(); }

}  // namespace terrace::tiler

// A tile's place on the globe, computed from the values that clients decode: positions, bounding sphere, and the
// horizon occlusion point. ECEF metres; pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

// Degrees and metres of quantized coordinates, linear in u, v and h, as every client decodes them. Coordinates on a
// shared edge are bit-equal in both tiles, and the poles are exact.
double LongitudeAt(const geo::TileKey& key, std::uint16_t u);
double LatitudeAt(const geo::TileKey& key, std::uint16_t v);
double HeightAt(const QuantizedTile& tile, std::uint16_t h);

// The tile's vertices in the tile's own order.
std::vector<geo::Vec3> DecodePositions(const QuantizedTile& tile);

// The same, if `positions` already has the first of them, or all: appends the others.
void DecodeFurtherPositions(const QuantizedTile& tile, std::vector<geo::Vec3>& positions);

struct BoundingSphere {
  geo::Vec3 center;
  double radius = 0;
};

// A sphere that contains every position, also as decoded by clients with another sine and cosine. It is the smaller of
// two: Ritter's sphere ("An Efficient Bounding Sphere", Graphics Gems 1990), and the sphere around the centre of the
// axis-aligned box. CesiumJS's BoundingSphere.fromPoints does the same. Precondition: not empty.
BoundingSphere EnclosingSphere(const std::vector<geo::Vec3>& positions);

// A point in ellipsoid-scaled space (x / 6378137, y / 6378137, z / 6356752.3) along `direction` (ECEF, any length) that
// is hidden behind the ellipsoid only if all positions are: clients cull a tile by this point alone (Ring, "Horizon
// Culling", cesium.com/blog/2013/04/25). All components are NaN if there is no such point, because a position is 90
// degrees or more from the direction. Clients then never cull the tile.
//
// For min_height < 0 CesiumJS reads the same numbers in the space of an ellipsoid whose radii are shrunk by as much
// (EllipsoidalOccluder.isScaledSpacePointVisiblePossiblyUnderEllipsoid); the point holds under either reading.
geo::Vec3 HorizonOcclusionPoint(const std::vector<geo::Vec3>& positions, geo::Vec3 direction, double min_height);

}  // namespace terrace::proto

// Where a tile lies on the globe, computed from what its bytes decode to: positions, bounding sphere, and the point
// that decides whether the tile is behind the horizon. ECEF metres; pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

// Degrees and metres of quantized coordinates, as every client decodes them: linear in u, v and h. Coordinates on a
// shared edge give the same bits from both tiles, and the poles are exact.
double LongitudeAt(const geo::TileKey& key, std::uint16_t u);
double LatitudeAt(const geo::TileKey& key, std::uint16_t v);
double HeightAt(const QuantizedTile& tile, std::uint16_t h);

// The tile's vertices in the tile's own order.
std::vector<geo::Vec3> DecodePositions(const QuantizedTile& tile);

// The same where the first of them, or all, are in `positions` already: the others are appended.
void DecodeFurtherPositions(const QuantizedTile& tile, std::vector<geo::Vec3>& positions);

struct BoundingSphere {
  geo::Vec3 center;
  double radius = 0;
};

// Contains every position, also as clients with their own sine and cosine decode them. The smaller of Ritter's sphere
// ("An Efficient Bounding Sphere", Graphics Gems 1990) and the one about the centre of the axis-aligned box: what
// CesiumJS's BoundingSphere.fromPoints takes. Precondition: not empty.
BoundingSphere EnclosingSphere(const std::vector<geo::Vec3>& positions);

// A point in ellipsoid-scaled space (x / 6378137, y / 6378137, z / 6356752.3) along `direction` (ECEF, any length) that
// is hidden behind the ellipsoid only where all positions are: clients cull a tile by this one point (Ring, "Horizon
// Culling", cesium.com/blog/2013/04/25). All components are NaN where no such point exists, because a position lies 90
// degrees or more from the direction: clients then never cull.
//
// For min_height < 0 CesiumJS reads the same numbers in the space of an ellipsoid whose radii are shrunk by as much
// (EllipsoidalOccluder.isScaledSpacePointVisiblePossiblyUnderEllipsoid); the point holds under either reading.
geo::Vec3 HorizonOcclusionPoint(const std::vector<geo::Vec3>& positions, geo::Vec3 direction, double min_height);

}  // namespace terrace::proto

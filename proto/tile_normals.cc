#include "proto/tile_normals.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/oct_normal.h"

namespace terrace::proto {
namespace {

// Steeper slopes are drawn as this one (88 degrees): the two bytes of a normal are up to 1 degree off and must not point
// into the ground.
constexpr double kSteepestSlope = 28;

// East, north and up of a node, from the normals of its meridian and its parallel.
struct LocalFrame {
  geo::Vec3 east, north, up;
};

LocalFrame FrameOf(double longitude, double latitude) {
  const geo::Vec3 meridian = geo::SurfaceNormal(longitude, 0);  // (cos lon, sin lon, 0)
  const geo::Vec3 parallel = geo::SurfaceNormal(0, latitude);   // (cos lat, 0, sin lat)
  return {{-meridian.y, meridian.x, 0},
          {-parallel.z * meridian.x, -parallel.z * meridian.y, parallel.x},
          {parallel.x * meridian.x, parallel.x * meridian.y, parallel.z}};
}

}  // namespace

std::vector<std::array<std::uint8_t, 2>> LatticeNormals(const LatticeView& lattice, const tin::TinMesh& mesh) {
  const double step = lattice.lattice.StepDegrees();
  std::vector<std::array<std::uint8_t, 2>> normals;
  normals.reserve(mesh.vertices.size());
  for (const tin::SamplePosition p : mesh.vertices) {
    const double latitude = lattice.Latitude(p.y);
    const LocalFrame frame = FrameOf(lattice.Longitude(p.x), latitude);
    geo::Vec3 normal = frame.up;
    if (latitude > -90 && latitude < 90) {
      const double rise_east = static_cast<double>(lattice.At(p.x + 1, p.y)) - static_cast<double>(lattice.At(p.x - 1, p.y));
      const double rise_north = static_cast<double>(lattice.At(p.x, p.y + 1)) - static_cast<double>(lattice.At(p.x, p.y - 1));
      const double east = rise_east / (2 * step * geo::MetresPerDegreeEast(latitude));
      const double north = rise_north / (2 * step * geo::MetresPerDegreeNorth(latitude));
      const double tamed = kSteepestSlope / std::max(std::hypot(east, north), kSteepestSlope);
      normal = geo::Normalized(frame.up - frame.east * (east * tamed) - frame.north * (north * tamed));
    }
    normals.push_back(OctEncode(normal));
  }
  return normals;
}

}  // namespace terrace::proto

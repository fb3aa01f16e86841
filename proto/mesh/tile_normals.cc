#include "proto/mesh/tile_normals.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "proto/lattice_angles.h"
#include "proto/mesh/oct_normal.h"

namespace terrace::proto {
namespace {

// Steeper slopes are limited to this one (88 degrees): encoded normals are up to 1 degree off and must not point into
// the ground.
constexpr double kSteepestSlope = 28;
constexpr double kLowestUp = 0.035;
// 13 degrees.
constexpr double kCosWidestTurn = 0.97437006478523525, kSinWidestTurn = 0.22495105434386500;

// East, north and up of a node.
struct LocalFrame {
  geo::Vec3 east, north, up;
};

LocalFrame FrameOf(geo::SinCos longitude, geo::SinCos latitude) {
  return {{-longitude.sin, longitude.cos, 0},
          {-latitude.sin * longitude.cos, -latitude.sin * longitude.sin, latitude.cos},
          {latitude.cos * longitude.cos, latitude.cos * longitude.sin, latitude.sin}};
}

// The central difference, limited to within 13 degrees (kCosWidestTurn) of van Leer's limited difference, which is zero
// if one of the two steps is level, as at the foot and at the top of a cliff that is one step wide. `before` and
// `after`: the slopes of the two steps.
double Limited(double central, double before, double after) {
  constexpr double kTangent = kSinWidestTurn / kCosWidestTurn;
  const double limited = before * after > 0 ? 2 / (1 / before + 1 / after) : 0, turned = limited * kTangent;
  if (turned < 1) central = std::min(central, (limited + kTangent) / (1 - turned));
  if (turned > -1) central = std::max(central, (limited - kTangent) / (1 + turned));
  return central;
}

// Metres over the two steps of a central difference on one row. Computed once a row: a square root and a division each.
class RowWidths {
 public:
  RowWidths(const TileSamples& samples, const std::vector<geo::SinCos>& rows)
      : samples_(samples), rows_(rows), step_(samples.lattice.StepDegrees()), widths_(rows.size()) {}

  struct Width {
    double east = 0, north = 0;
    bool is_pole = false;
  };
  const Width& At(int j) {
    Width& width = widths_[static_cast<std::size_t>(j)];
    if (width.north > 0) return width;
    const double latitude = samples_.Latitude(j);
    const geo::SinCos& row = rows_[static_cast<std::size_t>(j)];
    width = {2 * step_ * geo::MetresPerDegreeEast(row), 2 * step_ * geo::MetresPerDegreeNorth(row),
             latitude <= -90 || latitude >= 90};
    return width;
  }

 private:
  const TileSamples& samples_;
  const std::vector<geo::SinCos>& rows_;
  const double step_;
  std::vector<Width> widths_;
};

geo::Vec3 LatticeNormal(const TileSamples& samples, const LocalFrame& frame, const RowWidths::Width& across,
                        tin::SamplePosition p, bool is_on_edge) {
  if (across.is_pole) return frame.up;
  const double rise_east =
      static_cast<double>(samples.At(p.x + 1, p.y)) - static_cast<double>(samples.At(p.x - 1, p.y));
  const double rise_north =
      static_cast<double>(samples.At(p.x, p.y + 1)) - static_cast<double>(samples.At(p.x, p.y - 1));
  double east = rise_east / across.east, north = rise_north / across.north;
  if (is_on_edge) {
    const double height = static_cast<double>(samples.At(p.x, p.y));
    const double from_west = 2 * (height - static_cast<double>(samples.At(p.x - 1, p.y))) / across.east;
    const double from_south = 2 * (height - static_cast<double>(samples.At(p.x, p.y - 1))) / across.north;
    east = Limited(east, from_west, 2 * east - from_west);
    north = Limited(north, from_south, 2 * north - from_south);
  }
  const double factor = kSteepestSlope / std::max(std::sqrt(east * east + north * north), kSteepestSlope);
  return geo::Normalized(frame.up - frame.east * (east * factor) - frame.north * (north * factor));
}

// Sums of the cross products of the triangles around each vertex.
std::vector<geo::Vec3> AreaWeightedNormals(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                           const std::vector<geo::Vec3>& position) {
  std::vector<geo::Vec3> normals(position.size());
  for (const auto& [a, b, c] : triangles) {
    const geo::Vec3 cross = geo::Cross(position[b] - position[a], position[c] - position[a]);
    for (const std::uint32_t k : {a, b, c}) normals[k] = normals[k] + cross;
  }
  return normals;
}

// Turns `normal` towards `goal` until they are at most 13 degrees apart (kCosWidestTurn). Both are unit vectors. The
// goal is zero for triangles without area beside a pole; then `normal` is not turned.
geo::Vec3 TurnTowards(geo::Vec3 normal, geo::Vec3 goal) {
  const double cosine = geo::Dot(normal, goal);
  if (cosine >= kCosWidestTurn || (goal.x == 0 && goal.y == 0 && goal.z == 0)) return normal;
  const geo::Vec3 across = geo::Normalized(normal - goal * cosine);
  return goal * kCosWidestTurn + across * kSinWidestTurn;
}

}  // namespace

std::vector<geo::Vec3> VertexNormals(const TileSamples& samples, const tin::TinMesh& mesh,
                                     const std::vector<geo::Vec3>& positions) {
  const std::vector<geo::Vec3> of_mesh = AreaWeightedNormals(mesh.triangles, positions);
  std::vector<geo::Vec3> normals;
  normals.reserve(mesh.vertices.size());
  const LatticeAngles angles(samples);
  RowWidths widths(samples, angles.rows);
  for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
    const tin::SamplePosition p = mesh.vertices[k];
    const LocalFrame frame = FrameOf(angles.columns[p.x], angles.rows[p.y]);
    const bool is_on_edge = p.x == 0 || p.y == 0 || p.x == samples.cells() || p.y == samples.cells();
    geo::Vec3 normal = LatticeNormal(samples, frame, widths.At(p.y), p, is_on_edge);
    if (!is_on_edge) {
      const geo::Vec3 turned = TurnTowards(normal, geo::Normalized(of_mesh[k]));
      if (geo::Dot(turned, frame.up) > kLowestUp) normal = turned;
    }
    normals.push_back(normal);
  }
  return normals;
}

std::size_t CountMisfits(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions,
                         const std::vector<geo::Vec3>& normals) {
  constexpr double kCosWidest = 0.97236992039767667;
  const std::vector<geo::Vec3> of_mesh = AreaWeightedNormals(mesh.triangles, positions);
  std::size_t misfits = 0;
  for (std::size_t k = 0; k < normals.size(); ++k) {
    misfits += geo::Dot(normals[k], of_mesh[k]) < kCosWidest * geo::Length(of_mesh[k]) ? 1 : 0;
  }
  return misfits;
}

std::vector<std::array<std::uint8_t, 2>> TileNormals(const TileSamples& samples, const tin::TinMesh& mesh,
                                                     const std::vector<geo::Vec3>& positions) {
  std::vector<std::array<std::uint8_t, 2>> encoded;
  encoded.reserve(mesh.vertices.size());
  for (const geo::Vec3& normal : VertexNormals(samples, mesh, positions)) {
    encoded.push_back(OctEncode(normal));
  }
  return encoded;
}

}  // namespace terrace::proto

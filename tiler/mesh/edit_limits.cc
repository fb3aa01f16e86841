#include "tiler/mesh/edit_limits.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "engine/dem/tile_edits.h"
#include "engine/tin/scan/triangle_rows.h"
#include "tiler/mesh/error_allowed_at_samples.h"

namespace terrace::tiler {
namespace {

// Rounding to the nearest could allow more.
float RoundedDown(double value) {
  const auto rounded = static_cast<float>(value);
  return static_cast<double>(rounded) > value ? std::nextafter(rounded, 0.0F) : rounded;
}

}  // namespace

tin::SampleLimits LimitsOf(dem::MeshDemands demands) {
  tin::SampleLimits limits;
  for (float& cap : demands.caps) cap = RoundedDown(ErrorAllowedAtSamples(static_cast<double>(cap)));
  limits.weights = std::move(demands.weights);
  limits.caps = std::move(demands.caps);
  limits.forced = std::move(demands.forced);
  return limits;
}

std::vector<float> AllowedErrors(const tin::SampleLimits& limits, double error_m) {
  std::vector<float> allowed;
  allowed.reserve(limits.weights.size());
  for (std::size_t k = 0; k < limits.weights.size(); ++k) allowed.push_back(RoundedDown(limits.Allowed(k, error_m)));
  return allowed;
}

namespace {

// Sets the smallest allowed errors of a tile's own samples.
void AddOwnErrors(const tin::SampleLimits& limits, int cells, double error_m, proto::EdgeErrors& errors) {
  if (limits.weights.empty()) return;
  const auto at = [&](int x, int y) {
    return limits.Allowed(
        static_cast<std::size_t>(y) * static_cast<std::size_t>(cells + 1) + static_cast<std::size_t>(x), error_m);
  };
  for (int k = 1; k < cells; ++k) {
    const std::array<double, 4> of_sides = {at(k, 0), at(cells, k), at(k, cells), at(0, k)};
    for (std::size_t side = 0; side < 4; ++side) errors.side[side] = std::min(errors.side[side], of_sides[side]);
  }
  errors.corner = {at(0, 0), at(cells, 0), at(cells, cells), at(0, cells)};
}

}  // namespace

proto::EdgeErrors EdgeErrorsOf(const dem::ElevationModel& model, const geo::TileKey& key,
                               const tin::SampleLimits& limits, double error_m) {
  proto::EdgeErrors errors(error_m);
  if (dem::TileEdits(model).Hash(key) == 0) return errors;
  AddOwnErrors(limits, model.LatticeOf(key.level).cells, error_m, errors);
  const auto beyond = dem::TileEdits(model).DemandsBeyondCorners(key);
  for (std::size_t corner = 0; corner < 4; ++corner) {
    // Side k runs from corner k to corner k + 1.
    double& least_m = errors.corner[corner];
    least_m = std::min({least_m, errors.side[corner], errors.side[(corner + 3) % 4]});
    for (const dem::MeshDemands& demands : beyond[corner]) {
      const tin::SampleLimits of_edge = LimitsOf(demands);
      for (std::size_t k = 0; k < of_edge.weights.size(); ++k) least_m = std::min(least_m, of_edge.Allowed(k, error_m));
    }
  }
  // A pole is one point with one step in all tiles around it.
  if (key.y == 0) errors.side[0] = errors.corner[0] = errors.corner[1] = errors.tile;
  if (key.y + 1 == geo::TileRows(key.level)) errors.side[2] = errors.corner[2] = errors.corner[3] = errors.tile;
  return errors;
}

std::vector<std::uint8_t> TrianglesInHoles(const dem::MeshDemands& demands, int width, const tin::TinMesh& mesh) {
  if (demands.no_triangles.empty()) return {};
  const auto side = static_cast<std::size_t>(width);
  std::vector<std::uint8_t> in_hole(mesh.triangles.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    bool is_inside = true, is_outline = true;
    tin::ForEachRow({mesh.vertices[a], mesh.vertices[b], mesh.vertices[c]}, [&](int y, int first, int last) {
      for (int x = first; x <= last && is_inside; ++x) {
        const std::size_t k = static_cast<std::size_t>(y) * side + static_cast<std::size_t>(x);
        const bool is_forced = !demands.forced.empty() && demands.forced[k] != 0;
        is_inside = demands.no_triangles[k] != 0 || is_forced;
        is_outline = is_outline && demands.no_triangles[k] == 0;
      }
    });
    // A triangle between nodes of the outline alone may be outside.
    in_hole[t] = is_inside && !is_outline ? 1 : 0;
  }
  if (std::ranges::all_of(in_hole, [](std::uint8_t is) { return is == 0; })) return {};
  return in_hole;
}

void LeaveOut(const std::vector<std::uint8_t>& in_hole, const tin::TinMesh& mesh, int cells,
              std::vector<std::array<std::uint32_t, 3>>& triangles) {
  if (in_hole.empty()) return;
  std::vector<std::array<std::uint32_t, 3>> left;
  std::vector<std::uint8_t> has_triangle(mesh.vertices.size(), 0);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    if (in_hole[t] != 0) continue;
    left.push_back(triangles[t]);
    for (const std::uint32_t k : triangles[t]) has_triangle[k] = 1;
  }
  for (std::uint32_t k = 0; k < mesh.vertices.size(); ++k) {
    const tin::SamplePosition p = mesh.vertices[k];
    const bool on_edge = p.x == 0 || p.y == 0 || p.x == cells || p.y == cells;
    if (on_edge && has_triangle[k] == 0) left.push_back({k, k, k});
  }
  triangles = std::move(left);
}

}  // namespace terrace::tiler

// What edits require of a tile's mesh: precision by place, vertices that must be there, and holes (docs/edits.md).
#pragma once

#include <cstdint>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/edits/edit_effects.h"
#include "engine/geo/tile_key.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/sample_limits.h"
#include "proto/mesh/edge_steps.h"

namespace terrace::tiler {

// The limits that edits set for the samples of a tile or another field; empty: none.
tin::SampleLimits LimitsOf(dem::MeshDemands demands);

// The error that each sample may have in a tile of this error, row by row; empty: `error_m` everywhere.
std::vector<float> AllowedErrors(const tin::SampleLimits& limits, double error_m);

// The smallest error allowed on each side of a tile of this error, and at each corner over all four edges that end
// there, because a corner's height affects the samples of each of them. Neighbours have equal values for shared sides
// and corners. On a pole they are `error_m`. `limits`: of the tile.
proto::EdgeErrors EdgeErrorsOf(const dem::ElevationModel& model, const geo::TileKey& key,
                               const tin::SampleLimits& limits, double error_m);

// Whether a triangle is left out, for each triangle; empty: none is. A triangle is in a hole if each node that it
// covers, corners included, is in the hole or forced (MeshDemands), and at least one is in the hole.
// `width`: nodes in a row of the field.
std::vector<std::uint8_t> TrianglesInHoles(const dem::MeshDemands& demands, int width, const tin::TinMesh& mesh);

// Removes the triangles in holes. Vertices on the tile's edges stay, because clients need the lists of edges. An edge
// vertex k that no triangle refers to gets the degenerate triangle (k, k, k).
void LeaveOut(const std::vector<std::uint8_t>& in_hole, const tin::TinMesh& mesh, int cells,
              std::vector<std::array<std::uint32_t, 3>>& triangles);

}  // namespace terrace::tiler

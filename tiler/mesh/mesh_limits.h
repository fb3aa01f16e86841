// What edits ask of a tile's mesh: precision by place, vertices that must be there, and holes (docs/edits.md).
#pragma once

#include <cstdint>
#include <vector>

#include "engine/dem/dem_source.h"
#include "engine/geo/tile_key.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/sample_limits.h"
#include "proto/mesh/edge_steps.h"

namespace terrace::tiler {

// The error bound of a tile's mesh that keeps `error_m` to the ground: heights at nodes are rounded to 2^-10 m, and
// their positions are inexact.
double MeshError(double error_m);

// Empty if no edit asks for anything. Depends on edits, key and nodes alone.
tin::SampleLimits LimitsOf(const dem::DemSource& source, const geo::TileKey& key);

tin::SampleLimits LimitsOf(dem::MeshDemands demands);

// The error that each sample may have in a tile of this error, row by row; empty: `error_m` everywhere.
std::vector<float> AllowedErrors(const tin::SampleLimits& limits, double error_m);

// The smallest of them on each side and at each corner. Neighbours have the same numbers for what they share.
proto::EdgeErrors EdgeErrorsOf(const tin::SampleLimits& limits, int cells, double error_m);

// Whether a triangle is left out, for each triangle; empty: none is. A triangle is in a hole if all of its samples are,
// or are vertices of the hole's outline.
std::vector<std::uint8_t> TrianglesInHoles(const dem::DemSource& source, const geo::TileKey& key,
                                           const tin::TinMesh& mesh);
// The same of a field of `width` nodes a row.
std::vector<std::uint8_t> TrianglesInHoles(const dem::MeshDemands& demands, int width, const tin::TinMesh& mesh);

// Removes these triangles. Vertices of the tile's edges stay: a triangle of one point refers to each that no other
// triangle has, because clients need the lists of edges.
void LeaveOut(const std::vector<std::uint8_t>& in_hole, const tin::TinMesh& mesh, int cells,
              std::vector<std::array<std::uint32_t, 3>>& triangles);

}  // namespace terrace::tiler

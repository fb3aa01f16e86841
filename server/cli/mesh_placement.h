// Where the vertices of a raster's mesh lie in the file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/gltf/mesh_file.h"

namespace terrace::cli {

// From columns and rows, counted to the outer corner of the first pixel, to the file's x and y, in GDAL's order;
// nothing: x is the column and y the row.
using Placement = std::optional<std::array<double, 6>>;

// What `--coordinates` asks for; empty: the reference system where the raster has one.
Result<Placement> PlacementOf(const std::string& path, bool georeferenced, const std::array<double, 6>& geo_transform,
                              const std::string& coordinates);

std::vector<proto::MeshVertex> VerticesOf(const tin::TinMesh& mesh, const tin::HeightField& field,
                                          const Placement& placement);

// Counter-clockwise in the file's x and y.
std::vector<std::array<std::uint32_t, 3>> TrianglesOf(const tin::TinMesh& mesh, const Placement& placement);

}  // namespace terrace::cli

// The coordinates of a raster mesh's vertices in the output file.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/gltf/mesh_file.h"

namespace terrace::cli {

// Maps samples to coordinates in the file. Samples of a raster with a georeference lie at the centres of its pixels.
struct Placement {
  double first = 0;                                // column and row of the first sample
  proto::GridPlacement grid = {0, 1, 0, 0, 0, 1};  // without a georeference x is the column and y the row
};

// `coordinates`: value of `--coordinates`; empty: the reference system if the raster has one, else pixels.
Result<Placement> PlacementOf(const std::string& path, bool georeferenced, const std::array<double, 6>& geo_transform,
                              const std::string& coordinates);

// Returns columns, rows and heights on the placement's grid.
std::vector<proto::MeshVertex> VerticesOf(const tin::TinMesh& mesh, const tin::HeightField& field,
                                          const Placement& placement);

// Returns triangles that are counter-clockwise in the file's x and y.
std::vector<std::array<std::uint32_t, 3>> TrianglesOf(const tin::TinMesh& mesh, const Placement& placement);

}  // namespace terrace::cli

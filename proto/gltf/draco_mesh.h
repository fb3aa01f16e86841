// A GridMesh as the bytes of KHR_draco_mesh_compression.
//
// Positions are quantized on the mesh's own grid: Draco is given the grid (explicit quantization), so that clients
// decode the exact grid points. Both of Draco's connectivity coders may reorder triangles and points.
#pragma once

#include <array>
#include <string>

#include "engine/core/result.h"
#include "proto/gltf/glb_options.h"
#include "proto/mesh/grid_mesh.h"

namespace terrace::proto {

struct DracoMesh {
  std::string bytes;
  unsigned position_id = 0, normal_id = 0, uv_id = 0;  // Draco's unique ids
  // Of the decoded mesh.
  std::size_t points = 0, triangles = 0;
  std::array<double, 3> min{}, max{};  // metres from the mesh's origin
};

// Encodes, decodes the result and compares it: every triangle must have its grid points and, if picture coordinates are
// encoded, its lattice nodes in the picture. kInternal: Draco failed, or the comparison did. A broken tile is never
// returned.
Result<DracoMesh> EncodeDraco(const GridMesh& mesh, const DracoOptions& options);

}  // namespace terrace::proto

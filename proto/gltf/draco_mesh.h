// A GridMesh as the bytes of KHR_draco_mesh_compression.
//
// Positions are quantized on the mesh's own grid: Draco is given the grid (explicit quantization), so that clients
// decode the exact grid points. Both of Draco's connectivity coders may reorder triangles and points.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "engine/core/result.h"
#include "proto/mesh/grid_mesh.h"

namespace terrace::proto {

struct DracoOptions {
  int speed = 7;        // 0 smallest .. 10 fastest; 10 is sequential coding, below it edgebreaker
  int normal_bits = 8;  // 2 .. 16, of each of the two coordinates of an oct-encoded normal
  bool uv = false;      // texture coordinates as well, to a 4095th of the picture's edge
};

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

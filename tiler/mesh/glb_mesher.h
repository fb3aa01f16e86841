// From heights and their refinement to the mesh of a GLB tile.
#pragma once

#include <chrono>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "engine/tin/refinement.h"
#include "proto/lattice_view.h"
#include "proto/mesh/grid_mesh.h"
#include "tiler/mesh/tile_mesher.h"

namespace terrace::tiler {

struct MeshedGlb {
  proto::GridMesh mesh;                  // with normals and skirts
  double max_error_m = 0;                // of the flat triangles, measured on the grid points
  double surface_error_m = 0;            // the same everywhere, not at the lattice's samples alone
  std::chrono::microseconds replayed{};  // time until the mesh stood
};

// The mesh of the tile's quantized-mesh form to the same error, with its vertices on the grid of
// proto/mesh/grid_mesh.h, measured there, and mended where that rounding pushed a sample over the bound. Edges are
// never touched: an edge is refined to 15/16 of the error, and the grid's rounding is within the rest. `refinement` is
// as for MeshTile. Skirts hang for `skirt_error_m` (proto/mesh/skirt.h), as tilesets say. kCancelled: stopped.
Result<MeshedGlb> MeshGlb(const dem::DemSource& source, const proto::LatticeView& lattice,
                          const tin::Refinement& refinement, const MeshRules& rules, double wanted_error_m,
                          double skirt_error_m, proto::PositionWidth width, const std::stop_token& stop);

}  // namespace terrace::tiler

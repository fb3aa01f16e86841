// Makes the mesh of a GLB tile from heights and their refinement.
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
  double surface_error_m = 0;            // the same everywhere, not only at the lattice's samples
  std::chrono::microseconds replayed{};  // time until the mesh was replayed
};

// Takes the mesh of the tile's quantized-mesh form at the same error, and rounds its vertices to the grid of
// proto/mesh/grid_mesh.h. Measures the result, and inserts samples where rounding has pushed one over the bound. Edges
// do not change: they are refined to 15/16 of the error, and the grid's rounding takes less than the rest.
// `refinement`: as for MeshTile. `skirt_error_m`: determines the depth of skirts (proto/mesh/skirt.h), as in tilesets.
// kCancelled: stopped.
Result<MeshedGlb> MeshGlb(const dem::DemSource& source, const proto::LatticeView& lattice,
                          const tin::Refinement& refinement, const MeshRules& rules, double wanted_error_m,
                          double skirt_error_m, proto::PositionWidth width, const std::stop_token& stop);

}  // namespace terrace::tiler

// From heights and their refinement to the quantized mesh of a tile.
#pragma once

#include <chrono>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/refinement.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::tiler {

// How a dataset wants its tiles meshed.
struct MeshRules {
  tin::Criterion criterion = tin::Criterion::kDelaunay;
  bool compact = false;  // with the drop pass (engine/tin/decimate/drop_pass.h)
};

struct MeshedTile {
  tin::TinMesh mesh;
  proto::QuantizedTile tile;
  double max_error_m = 0;                // measured on the encoded integers
  double surface_error_m = 0;            // the same everywhere, not at the lattice's samples alone
  std::chrono::microseconds replayed{};  // time until the mesh stood; quantizing and measuring came after it
};

struct StartedMesh {
  tin::TinMesh mesh;
  double error_m = 0;  // what its inside holds; more than was wanted where the vertices would not fit the format
};

// What a build ends with when it was stopped.
tl::unexpected<Error> Cancelled();

// The samples of a tile without the halo.
tin::HeightField FieldOf(const proto::LatticeView& lattice);

// How the tile is refined, for every error at once (refine_plan.h).
tin::GreedyOptions PlanOf(const dem::DemSource& source, const proto::LatticeView& lattice, tin::Criterion criterion);

// The tile's mesh to the error before it is quantized: replayed, and dropped where the rules say so. `refinement` is
// as for MeshTile. kCancelled: stopped.
Result<StartedMesh> StartMesh(const dem::DemSource& source, const proto::LatticeView& lattice,
                              const tin::Refinement& refinement, const MeshRules& rules, double wanted_error_m,
                              const std::stop_token& stop);

// The tile's mesh to the error: replayed, dropped where the rules say so, quantized, measured, and mended where the
// quantization pushed a sample over the bound. `refinement` is PlanOf's run to this error or a finer one, or one
// that ended above the format's number of vertices: then the inside is coarser, the edges are not. A tile with a
// triangle that rounding would turn over is meshed by the plain rules. kCancelled: stopped.
Result<MeshedTile> MeshTile(const dem::DemSource& source, const proto::LatticeView& lattice,
                            const tin::Refinement& refinement, const MeshRules& rules, double wanted_error_m,
                            const std::stop_token& stop);

}  // namespace terrace::tiler

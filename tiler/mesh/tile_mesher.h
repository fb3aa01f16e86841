// Makes the mesh of a tile from heights and their refinement, and quantizes it.
#pragma once

#include <chrono>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/refinement.h"
#include "proto/mesh/quantized_mesh.h"
#include "proto/tile_samples.h"
#include "tiler/mesh/mesh_options.h"

namespace terrace::tiler {

struct MeshedTile {
  tin::TinMesh mesh;
  std::vector<std::uint8_t> in_hole;  // by triangle, as TrianglesInHoles (edit_limits.h)
  proto::QuantizedTile tile;
  std::vector<geo::Vec3> positions;         // of its vertices, ECEF
  double max_error_m = 0;                   // at the lattice's samples, measured on the encoded integers
  double surface_error_m = 0;               // the same everywhere, not only at the samples
  std::chrono::microseconds replay_time{};  // of ReplayMesh
};

struct ReplayedMesh {
  tin::TinMesh mesh;
  // The bound that holds inside the tile. Larger than requested if the format's vertex limit was reached.
  double error_m = 0;
};

// The error value of a stopped build.
tl::unexpected<Error> Cancelled();

// The samples of a tile without the halo.
tin::HeightField FieldOf(const proto::TileSamples& samples);

// Makes the mesh for the error: replays the refinement or, if there is none, inserts anew with a larger error inside
// the tile but not on its edges. Then the drop pass (tin::DropVertices) if MeshOptions::compact is set, and
// WithInnerVertices (inner_vertices.h). The mesh is not quantized yet. `refinement` as for MeshTile. kCancelled:
// stopped.
Result<ReplayedMesh> ReplayMesh(const dem::ElevationModel& model, const proto::TileSamples& samples,
                                const std::optional<tin::Refinement>& refinement, const MeshOptions& mesh_options,
                                double wanted_error_m, const std::stop_token& stop);

// ReplayMesh, then quantizes, measures, and inserts samples that quantization pushed over the bound. `refinement` was
// run with RefineOptionsOf to this error or a finer one; none: such a run needs more vertices than the format allows.
// Then the inside is coarser than requested and the edges are not. If quantization would flip a triangle, the tile is
// refined anew by the Delaunay criterion, without drop pass and WithInnerVertices. kCancelled: stopped.
// kInternal: even so a triangle is flipped.
Result<MeshedTile> MeshTile(const dem::ElevationModel& model, const proto::TileSamples& samples,
                            const std::optional<tin::Refinement>& refinement, const MeshOptions& mesh_options,
                            double wanted_error_m, const std::stop_token& stop);

}  // namespace terrace::tiler

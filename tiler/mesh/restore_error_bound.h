// Restores the error bound of a mesh after its vertices were rounded.
#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/error/tile_error.h"

namespace terrace::tiler {

// Rounds the vertices of a mesh as its format does, and measures the decoded mesh.
using MeasureMesh = std::function<proto::TileError(const tin::TinMesh&)>;

// Inserts the samples that `measure` names (TileError::to_insert) until all samples keep the bound. If a side of a
// triangle passes between a vertex that exceeds the bound and a vertex at a neighbouring sample
// (TileError::is_cut_through), triangulates all vertices again, by Delaunay, and goes on. Returns the measurement of
// the final mesh. The largest error exceeds the bound only in these cases:
// - Rounding moved a vertex away from its sample, and all neighbouring samples are vertices already. The excess is at
//   most the change of the ground over the distance that the vertex was moved.
// - The format rounds heights. The excess is at most that.
// - A sample is on an edge of the tile or beside one: `measure` names no samples on edges, which neighbours share.
// - The mesh would need more than `max_vertices`.
// kCancelled: stopped.
Result<proto::TileError> RestoreErrorBound(tin::TinMesh& mesh, const MeasureMesh& measure, std::size_t max_vertices,
                                           const std::stop_token& stop);

}  // namespace terrace::tiler

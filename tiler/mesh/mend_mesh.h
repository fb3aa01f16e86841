// Keeping the error of a mesh after the rounding of its vertices.
#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/error/tile_error.h"

namespace terrace::tiler {

// Rounds the vertices of a mesh as its format does, and measures what clients will decode.
using MeasureMesh = std::function<proto::TileError(const tin::TinMesh&)>;

// Inserts samples inside the mesh until none of them misses the bound of `measure`, and returns the last measurement,
// which is of the mesh as it then is. Its largest error is above the bound only
// - at vertices whose rounded positions lie beside their samples, all of whose neighbours are vertices too: by the
//   steps between these samples, as far as the positions are off;
// - by what the format's own rounding of heights takes;
// - on the tile's edges, where nothing may be inserted;
// - if the mesh would get more than `max_vertices`.
// kCancelled: stopped.
Result<proto::TileError> MendMesh(tin::TinMesh& mesh, const MeasureMesh& measure, std::size_t max_vertices,
                                  const std::stop_token& stop);

}  // namespace terrace::tiler

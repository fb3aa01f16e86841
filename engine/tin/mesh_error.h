// The distance between a mesh and its field, measured independently of the run that made the mesh.
#pragma once

#include <cstddef>
#include <stop_token>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

struct MeshError {
  double max = 0;           // metres, vertical, over every valid sample, borders and vertices included
  double rms = 0;           // metres, over the same samples
  std::size_t samples = 0;  // valid samples that the mesh covers: fewer than the field has if the mesh has a hole
  SamplePosition worst;     // the first sample in row-major order with the error `max`
};

// Rasterizes every triangle with exact integer coverage. A sample on an edge counts once. Vertices have the heights of
// HeightField::VertexHeight. If `stop` is requested, returns what was measured until then. Safe to call from many
// threads at once.
MeshError MeasureError(const HeightField& field, const TinMesh& mesh, std::stop_token stop = {});

}  // namespace terrace::tin

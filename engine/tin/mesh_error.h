// How far a mesh is from the field it approximates, measured afresh: nothing is taken from the run that made the mesh.
#pragma once

#include <cstddef>
#include <stop_token>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

struct MeshError {
  double max = 0;           // metres, vertical, over every valid sample, borders and vertices included
  double rms = 0;           // metres, over the same samples
  std::size_t samples = 0;  // valid samples that the mesh covers: all of them, or it has a hole
  SamplePosition worst;     // the first sample in row-major order that is `max` off
};

// Rasterizes every triangle with exact integer coverage; a sample on an edge counts once. Vertices have the field's
// VertexHeight. When `stop` is requested, what was measured until then. Safe to call from many threads at once.
MeshError MeasureError(const HeightField& field, const TinMesh& mesh, std::stop_token stop = {});

}  // namespace terrace::tin

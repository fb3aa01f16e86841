// The distance between a coloured mesh and its extended field, measured independently of the run that made the mesh.
#pragma once

#include <cstddef>
#include <stop_token>

#include "engine/tin/extended/extended_field.h"
#include "engine/tin/extended/extended_greedy.h"
#include "engine/tin/mesh_error.h"

namespace terrace::tin {

struct ExtendedError {
  MeshError height;               // of the heights alone, over every valid sample
  double max_combined = 0;        // metres, the formula of extended_field.h over the same samples
  double color_rms = 0;           // root mean square over r, g, b of the color_samples; range 0 to 1
  std::size_t color_samples = 0;  // valid samples with a known colour
};

// Rasterizes every triangle with exact integer coverage; a sample on an edge counts once. If `stop` is requested,
// returns what was measured until then. Safe to call from many threads at once.
ExtendedError MeasureExtendedError(const ExtendedField& field, const ColoredMesh& mesh, std::stop_token stop = {});

}  // namespace terrace::tin

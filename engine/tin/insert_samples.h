// Samples inserted into a finished mesh.
#pragma once

#include <span>

#include "engine/tin/tin_mesh.h"

namespace terrace::tin {

// Joins each sample to the triangles whose circle it lies in, as far as it sees them: what was Delaunay stays so, and any
// other mesh stays a mesh. Samples that are vertices already are skipped; border samples are refused (TERRACE_CHECK):
// borders are a function of their own samples. Precondition: the mesh covers a rectangle once, its corners first.
TinMesh InsertSamples(const TinMesh& mesh, std::span<const SamplePosition> samples);

}  // namespace terrace::tin

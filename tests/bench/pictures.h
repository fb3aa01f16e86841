// Pictures of height fields and meshes, for documentation.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::bench {

// Grey values, row by row from the top.
struct Picture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> grey;
};

// The mesh's height at every sample of the field.
tin::HeightField SampledMesh(const tin::HeightField& field, const tin::TinMesh& mesh);

// Light from the north-west at 45 degrees; row 0 is in the north, samples are `spacing_m` apart. Grey values are in
// steps of 1/64: the difference is not visible, and files are half as large.
Picture Hillshade(const tin::HeightField& field, double spacing_m);

// The mesh's edges, black on white, `scale` pixels to a sample.
Picture Wireframe(const tin::HeightField& field, const tin::TinMesh& mesh, int scale);

// kUnavailable: the file cannot be written.
Result<void> WritePng(const Picture& picture, const std::string& path);

}  // namespace terrace::bench

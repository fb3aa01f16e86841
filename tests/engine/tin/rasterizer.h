// Rasterizes a mesh independently of the mesher, to check the mesher's promises on real data.  It uses only TinMesh and
// the samples of HeightField of the engine. Coverage is computed in integers, heights in long double by barycentric
// coordinates. Thread-safe.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

struct Rasterization {
  double max_error = 0;      // metres, vertical, over the valid samples that a triangle covers
  SamplePosition worst;      // a sample with this error
  double magnitude = 0;      // the largest absolute height of a valid sample or a vertex
  std::size_t turned = 0;    // triangles that are not counter-clockwise; not rasterized
  std::size_t not_once = 0;  // samples, voids included, that no triangle covers, or more than one
  // Edges used twice in one direction, or once and not along the field's border. If there are none and the areas add up
  // to the field's, counter-clockwise triangles cover every point of the field once, and not only the samples.
  std::size_t open_edges = 0;
  bool has_area_of_field = false;
};

// A sample on an edge belongs to the triangle that contains the sample after an infinitesimal shift along x, and a far
// smaller one along y, into the field. The shifted point is on no edge.
Rasterization Rasterize(const HeightField& field, const TinMesh& mesh);

// Whether the triangles cover the field once and no valid sample has an error above `bound`, allowing one part in 10^9
// of it and the rounding of the mesher's doubles at heights of this magnitude.
testing::AssertionResult Keeps(const Rasterization& raster, double bound);

}  // namespace terrace::tin

// A mesh rasterized by code that has nothing in common with the mesher's: what its promises are held to on real data.
//
// Of the engine it takes TinMesh and the samples of HeightField. Coverage is decided in integers, heights in long
// double by barycentric coordinates. Safe to call from many threads at once.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

struct Rasterization {
  double max_error = 0;      // metres, vertical, over the valid samples that a triangle covers
  SamplePosition worst;      // one that is so far off
  double magnitude = 0;      // the largest absolute height of a valid sample or a vertex
  std::size_t turned = 0;    // triangles that are not counter-clockwise; not rasterized
  std::size_t not_once = 0;  // samples, voids included, that no triangle covers, or more than one
  // Edges that are used twice in one direction, or once and not along the field's border. Without any, and with the
  // field's area, counter-clockwise triangles cover every point of the field once, not the samples alone.
  std::size_t open_edges = 0;
  bool has_area_of_field = false;
};

// A sample on an edge belongs to the triangle that also holds the point next to it, moved by less than any distance
// that matters: along x first, then along y, into the field. That point is on no edge.
Rasterization Rasterize(const HeightField& field, const TinMesh& mesh);

// Whether the triangles cover the field once and no valid sample is further off than `bound`, up to one part in 10^9 of
// it and what the mesher's doubles round at heights as large as these.
testing::AssertionResult Keeps(const Rasterization& raster, double bound);

}  // namespace terrace::tin

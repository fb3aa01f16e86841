// The error of an encoded tile, measured on the integers that clients decode.
#pragma once

#include <memory>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/mesh/quantized_mesh.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

struct TileError {
  double max_m = 0;  // over every lattice sample of the tile
  // Samples to insert: for each triangle that exceeds the bound, its worst sample inside the tile that is not a vertex.
  // If no triangle has such a sample: the neighbours of the vertices that exceed the bound. Such a vertex exceeds it
  // because rounding moved it along a steep triangle; once its neighbours are vertices, the triangles around it are no
  // steeper than the ground. Empty if nothing can be inserted, whatever max_m is.
  std::vector<tin::SamplePosition> to_insert;
  // Nothing can be inserted, but a vertex exceeds the bound because a side of a triangle passes between it and a vertex
  // at a neighbouring sample. A Delaunay triangulation has no such sides.
  bool is_cut_through = false;
};

// Measures the mesh of a tile repeatedly while samples are inserted. Triangles that have not changed since the last
// call are not measured again. All meshes must be of the tile given by `samples`.
class TileErrorMeter {
 public:
  // `allowed_m`: the bound of each sample, at most `bound_m`, row by row; empty: `bound_m` everywhere.
  TileErrorMeter(const TileSamples& samples, double bound_m, std::vector<float> allowed_m = {});
  ~TileErrorMeter();

  // Measures two surfaces at every lattice sample: the height interpolated in longitude and latitude, which clients
  // sample; and the flat triangle in ECEF, which clients draw, where it meets the sample's plumb line (the ellipsoid's
  // normal). If triangles overlap along a plumb line, the one farthest from the sample counts.
  TileError Measure(const QuantizedTile& tile);

  // Measures only the flat triangles of `mesh`, with its vertices near lattice nodes, at `positions` in ECEF. A
  // triangle with coinciding corners counts as a line.
  TileError MeasureFlat(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions);

  // Of the vertices of the mesh that was measured last: ECEF, as clients decode them.
  const std::vector<geo::Vec3>& positions() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Whether all triangles are counter-clockwise in (u, v): rounding positions to 15 bits can flip a sliver.
bool AllCounterClockwise(const QuantizedTile& tile);

}  // namespace terrace::proto

// How far an encoded tile is off, measured on the integers that clients will decode.
#pragma once

#include <memory>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

struct TileError {
  double max_m = 0;  // over every lattice sample of the tile
  // What to insert: for each triangle that misses the bound, its worst sample inside the tile that is no vertex. If no
  // such sample misses it any more, the neighbours of vertices that do, which the rounding of positions moved along
  // steep triangles: between neighbours they are no steeper than the ground. Empty if nothing is left to insert,
  // whatever max_m is.
  std::vector<tin::SamplePosition> misses;
  // Nothing is left to insert, but a vertex misses the bound by a triangle with an edge that passes between it and its
  // neighbours, as none of a Delaunay triangulation does.
  bool is_cut_through = false;
};

// Measures the mesh of a tile, again and again while samples are inserted into it: triangles that are what they were
// the time before are not looked at again. All meshes are those of the lattice's tile.
class TileMeter {
 public:
  TileMeter(const LatticeView& lattice, double bound_m);
  ~TileMeter();

  // Measures at every lattice sample two readings of the surface: the height interpolated in longitude and latitude,
  // which is what clients sample, and the flat triangle in ECEF, which is what they draw, where the plumb line of the
  // sample (the ellipsoid's normal) passes through it. Where triangles overlap along a plumb line, the farthest one
  // counts.
  TileError Measure(const QuantizedTile& tile);

  // The flat triangles alone, of `mesh` with its vertices near lattice nodes, at `positions` in ECEF. Triangles whose
  // corners merged on the way count as what is left of them, a line.
  TileError MeasureFlat(const tin::TinMesh& mesh, const std::vector<geo::Vec3>& positions);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// True if all triangles are counter-clockwise in (u, v): rounding positions to 15 bits could turn a sliver.
bool AllCounterClockwise(const QuantizedTile& tile);

}  // namespace terrace::proto

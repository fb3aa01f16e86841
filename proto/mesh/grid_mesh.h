// The triangles of a GLB tile with all positions on one grid of Earth-centred coordinates, skirts included.
//
// Every position is a whole number of steps from the Earth's centre. The step is a power of two that depends on level,
// error, lattice and width of the numbers. Therefore neighbours of one level and one error have bit-equal positions at
// a shared lattice node, whatever their tiles' origins, and a client that decodes origin + step * integer in floats
// decodes the position exactly.
//
// Pure functions; thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/mesh/edge_steps.h"
#include "proto/mesh/position_width.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

// Metres, a power of two. At most a 32nd of the error, so that rounding takes at most 3 % of it on level ground. At
// most a 64th of the side of a lattice cell on the ground, so that few triangles flip. Never below 2^-16 m, which
// matters to errors below half a millimetre, and never so small that a tile's side has more than 2^23 steps, which
// matters at an error_fraction below 0.11: the step is then up to a 15th of the finest errors. With the default error
// of its level a tile spans less than 2^16 steps.
//
// Floats allow finer steps. With floats the step is also at most 2^-7 m, so that all vertices of a tile's edge are less
// than a centimetre from the meridian or parallel where the tile ends: clients can find the vertices of an edge by
// their positions. On levels 0 to 8 a tile is too wide for that, and the step is the smallest that fits:
// 2^-6 m at level 8, 1 m at level 2.
double GridStep(const geo::Lattice& lattice, double error_m, PositionWidth width);

// Whole steps along the axes of ECEF.
using GridPoint = std::array<std::int64_t, 3>;

// The steps of a tile with limits by place (EdgeErrors). `smallest_allowed_m`: the smallest error that a sample of the
// tile may have. All steps are multiples of `inside`. Limits refine a step only until
// a tile's side spans 2^22 to 2^23 steps, as with the finest error.
struct GridSteps {
  double inside = 1;
  std::array<double, 4> side{}, corner{};

  GridSteps(const geo::Lattice& lattice, const EdgeErrors& errors, double smallest_allowed_m, PositionWidth width);
  // For tiles that do not fit (FitsFloats). Steps of sides and corners stay unless they are finer than `inside`.
  void Double();
};

// The vertices of `mesh` at their exact lattice positions and heights, rounded to the grid; on edges to the grids of
// side and corner, which both neighbours have. In units of `inside`. The point of a node does not depend on the tile.
// Sines and cosines have the same bits on every processor (engine/geo/sine.h), and so do the points.
std::vector<GridPoint> SnapVertices(const TileSamples& samples, const tin::TinMesh& mesh, const GridSteps& steps);

// Whether decoders that compute in 32-bit floats decode all points, and the lower rim of skirts of this depth, exactly.
// This is so if the tile spans less than 2^23 steps. A float has one bit more, but Draco adds one half. False for very
// high cliffs in deep tiles with small errors: hundreds of metres of height within a few metres. The caller then
// doubles the step until the tile fits, and its edges are off by up to half of that step.
bool FitsFloats(const std::vector<GridPoint>& points, double step_m, double skirt_depth_m);

// Metres.
std::vector<geo::Vec3> GridPositions(const std::vector<GridPoint>& points, double step_m);

struct GridMesh {
  double step_m = 1;
  GridPoint origin{};                                   // of the positions, in steps from the Earth's centre
  std::vector<std::array<std::int32_t, 3>> positions;   // ECEF axes, in steps; the middle of their box is near 0
  std::vector<geo::Vec3> normals;                       // unit, ECEF, one per position
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise from outside
  // Where each position is in a picture of the tile: lattice columns from the west, rows from the NORTH, 0 .. cells.
  // Vertices of the lower rim of skirts have those of the vertices above them.
  int cells = 1;
  std::vector<std::array<std::uint16_t, 2>> uv;
};

// The tile's surface, and skirts below its four edges. The upper rim of a skirt has the edge's own vertices. Its lower
// rim has the normals of the edge, so that a skirt is lit like the ground above it.
//
// Triangles with two equal corners are left out. Where points coincide, as in a pole's row, edges collapse in both
// neighbours and the surface stays closed. `left_out`: by triangle, 1 for those in holes, which get no skirts; empty:
// none. If no triangle is left, the skirt of one edge of the rim is kept, because decoders expect a triangle. `points`
// and `normals` have one entry per vertex.
GridMesh MakeGridMesh(const TileSamples& samples, const tin::TinMesh& mesh, const std::vector<GridPoint>& points,
                      const std::vector<geo::Vec3>& normals, double step_m, double skirt_depth_m,
                      const std::vector<std::uint8_t>& left_out = {});

}  // namespace terrace::proto

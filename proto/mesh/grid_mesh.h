// The triangles of a GLB tile with all positions on one grid of Earth-centred coordinates, skirts included.
//
// Every position is a whole number of steps from the Earth's centre, and the step is a power of two that level, error,
// lattice and width of the numbers decide: neighbours of one level and one error that share a lattice node share its
// position bit for bit, whatever their tiles' origins, and a client that decodes origin + step * integer in floats
// decodes it exactly.
//
// Pure functions; thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"

namespace terrace::proto {

// What a client is given a position in.
enum class PositionWidth : std::uint8_t { k16Bits, kFloat };

// Metres, a power of two: at most a 32nd of the error, so that rounding takes at most 3 % of it on level ground, and at
// most a 64th of a lattice cell's height, so that few triangles turn over; but never below 2^-16 m, which matters to
// errors below half a millimetre. At the default error of a level a tile then spans less than 2^16 steps; at the
// finest, less than 2^23.
//
// Floats have room for more. With them the step is also at most 2^-7 m, so that no vertex of a tile's edge is a
// centimetre off the meridian or parallel where the tile ends: a client may tell by position which edge a vertex is on.
// From level 8 up a tile is too wide for that, and the step is the least that fits, 2^-6 m there and 1 m at level 2.
double GridStep(const geo::Lattice& lattice, double error_m, PositionWidth width);

// Whole steps along the axes of ECEF.
using GridPoint = std::array<std::int64_t, 3>;

// The vertices of `mesh` at their exact lattice positions and heights, rounded to the grid. A node's point does not
// depend on the tile that asks. libm's sine may differ in the last bit between processors; geo::ToEcef rounds it to a
// micrometre, so two processors can differ here only where a coordinate lies within one of a tie.
std::vector<GridPoint> SnapVertices(const LatticeView& lattice, const tin::TinMesh& mesh, double step_m);

// Whether decoders that compute in 32-bit floats find every point, and the feet of skirts of this depth: the tile spans
// less than 2^23 steps, a bit less than a float has, since Draco adds a half on the way. False where a cliff is
// higher than a deep and fine tile can say: hundreds of metres within a few. Then the tile takes a step twice as
// coarse, until it fits, and its edges are off by up to half of that step.
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
  // The feet of skirts have those of the rim above them.
  int cells = 1;
  std::vector<std::array<std::uint16_t, 2>> uv;
};

// The tile's surface and, hanging down from its four edges, its skirts: their upper rim is the edge's own vertices,
// with the normals of the edge all the way down, so that they are lit like the ground they continue.
//
// Triangles with two corners at one point are left out: where points merge, as all of a pole's row do, edges collapse
// in both neighbours alike and the surface stays closed. `points` and `normals` have an entry for every vertex.
GridMesh MakeGridMesh(const LatticeView& lattice, const tin::TinMesh& mesh, const std::vector<GridPoint>& points,
                      const std::vector<geo::Vec3>& normals, double step_m, double skirt_depth_m);

}  // namespace terrace::proto

// The distance between a tile's surface and the surface through its lattice samples, everywhere and not only at the
// samples.
//
// The lattice surface is bilinear in longitude and latitude between four neighbouring samples. The error at the samples
// (tile_error.h) and the error along the edges of triangles together bound the distance at every position of the tile.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/mesh/quantized_mesh.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

// Returns a bound on the distance between the two surfaces in metres, everywhere in the tile, both for the height
// interpolated in longitude and latitude and for the flat triangles in ECEF. It is the larger of `at_samples_m`
// (TileError::max_m) and a bound along the edges of all triangles, plus a bound on how far flat triangles leave the
// lines between these positions; docs/decisions/0011-certified-error.md has the
// proof.
//
// `positions`: of the tile's vertices, DecodePositions.
double MeasureSurfaceError(const TileSamples& samples, const QuantizedTile& tile,
                           const std::vector<geo::Vec3>& positions, double at_samples_m);

// The same for flat triangles whose vertices, at `positions`, lie near lattice nodes, as in
// TileErrorMeter::MeasureFlat.
double MeasureFlatSurfaceError(const TileSamples& samples, const tin::TinMesh& mesh,
                               const std::vector<geo::Vec3>& positions, double at_samples_m);

}  // namespace terrace::proto

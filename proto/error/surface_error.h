// The distance between a tile's surface and the surface through its lattice samples, everywhere and not only at the
// samples.
//
// The lattice surface is bilinear in longitude and latitude between four neighbouring samples. The error measured here
// and the error at the samples (tile_error.h) together bound the distance at every position of the tile.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

// Metres: at least the distance between the two surfaces along the edges of all triangles, both for the height
// interpolated in longitude and latitude and for the flat triangles in ECEF. The larger of this and TileError::max_m
// bounds both surfaces everywhere in the tile; docs/decisions/0011-certified-error.md has the proof.
//
// `positions`: of the tile's vertices, DecodePositions.
double MeasureEdgeError(const LatticeView& lattice, const QuantizedTile& tile, const std::vector<geo::Vec3>& positions);

// The same for flat triangles with their vertices at exact lattice positions, as in TileErrorMeter::MeasureFlat.
double MeasureFlatEdgeError(const LatticeView& lattice, const tin::TinMesh& mesh,
                            const std::vector<geo::Vec3>& positions);

}  // namespace terrace::proto

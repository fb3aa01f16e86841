// How far a tile's surface is from the surface that its lattice samples span, everywhere and not at the samples alone.
//
// The lattice surface is bilinear in longitude and latitude between four neighbouring samples. Together with the error
// at the samples (tile_error.h) what is measured here bounds the distance at every place of the tile.
#pragma once

#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

// Metres: at least the distance between the two surfaces wherever a triangle's edge runs, for the height interpolated
// in longitude and latitude and for the flat triangles in ECEF. The larger of this and TileError::max_m bounds both
// readings at every place of the tile: docs/decisions/0011-certified-error.md has the proof.
double MeasureEdgeError(const LatticeView& lattice, const QuantizedTile& tile);

// The same of flat triangles with their vertices at exact lattice positions, as TileMeter::MeasureFlat reads them.
double MeasureFlatEdgeError(const LatticeView& lattice, const tin::TinMesh& mesh,
                            const std::vector<geo::Vec3>& positions);

}  // namespace terrace::proto

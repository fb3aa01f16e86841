// Heights and normals at points of a drawn surface: of the meshes that clients decode.
#pragma once

#include <span>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "tiler/surface/drawn_tiles.h"
#include "tiler/surface/point_heights.h"

namespace terrace::tiler {

// Heights at points, with the tile of each. A point belongs to the tile of `level` that it lies in, or to its deepest
// available ancestor. On an edge between two tiles it belongs to the eastern and the northern one. Beside an edge where
// only the neighbour has triangles, it belongs to the neighbour. In holes that edits cut, heights and normals are NaN.
// `normals`: adds normals. kInvalidArgument: too many tiles.
Result<PointHeights> ReadDrawnPoints(const HasTile& has_tile, int level, std::span<const dem::GeoPosition> points,
                                     bool normals, const FindMesh& find_mesh, const std::stop_token& stop);

}  // namespace terrace::tiler

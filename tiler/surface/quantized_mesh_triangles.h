// The triangles that clients decode from a quantized-mesh tile.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "proto/mesh/quantized_mesh.h"
#include "tiler/surface/drawn_mesh.h"

namespace terrace::tiler {

// All triangles of a tile, with the positions of its vertices.
DrawnTriangles TrianglesOf(const proto::QuantizedTile& tile);

// The triangles of a finished tile. kUnavailable: the bytes are not such a tile.
Result<DrawnTriangles> DecodeTriangles(std::string_view bytes, const geo::TileKey& key);

}  // namespace terrace::tiler

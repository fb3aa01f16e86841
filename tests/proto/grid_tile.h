// Regular tiles for tests: every vertex of a grid, two triangles a cell.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "proto/mesh/quantized_mesh.h"

namespace terrace::proto {

using QuantizedHeight = std::function<std::uint16_t(int column, int row)>;

// (columns + 1) x (rows + 1) vertices, row by row from the south-west; triangles counter-clockwise. Heights are
// 0..32767. With normals: straight up from the ellipsoid.
QuantizedTile GridTile(const geo::TileKey& key, int columns, int rows, float min_height, float max_height,
                       const QuantizedHeight& height);

// With the positions that clients decode.
std::string EncodeQuantizedMesh(const QuantizedTile& tile, const TileExtensions& extensions);

// Random heights that include 0 and 32767, the same in every run.
QuantizedHeight Rugged();

}  // namespace terrace::proto

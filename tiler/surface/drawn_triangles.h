// The triangles that clients decode from a tile of each format.
#pragma once

#include <stop_token>
#include <string_view>

#include "engine/core/result.h"
#include "tiler/surface/drawn_mesh.h"

namespace terrace::tiler {

struct EncoderInput;  // tile_pipeline.h

// The triangles in the bytes that EncodeQuantizedMesh and EncodeGlb (encoders.h) make of the same input. Same errors.
Result<DrawnTriangles> DrawnByQuantizedMesh(const EncoderInput& input, const std::stop_token& stop);
Result<DrawnTriangles> DrawnByGlb(const EncoderInput& input, const std::stop_token& stop);  // encoders/glb.cc

// The triangles of a finished quantized-mesh tile. kUnavailable: the bytes are not such a tile.
Result<DrawnTriangles> DrawnByBytes(std::string_view bytes, const geo::TileKey& key);

}  // namespace terrace::tiler

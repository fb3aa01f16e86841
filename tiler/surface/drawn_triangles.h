// The triangles that clients decode from a tile of each format.
#pragma once

#include <stop_token>
#include <string_view>

#include "engine/core/result.h"
#include "tiler/surface/drawn_mesh.h"

namespace terrace::tiler {

struct EncoderInput;  // tile_pipeline.h

// Those of the bytes that EncodeQuantizedMesh and EncodeGlb (encoders.h) make of the same input. Errors: theirs.
Result<DrawnTriangles> DrawnByQuantizedMesh(const EncoderInput& input, const std::stop_token& stop);
Result<DrawnTriangles> DrawnByGlb(const EncoderInput& input, const std::stop_token& stop);  // encoders/glb.cc

// Those of a finished tile of quantized-mesh; kUnavailable: the bytes are none.
Result<DrawnTriangles> DrawnByBytes(std::string_view bytes, const geo::TileKey& key);

}  // namespace terrace::tiler

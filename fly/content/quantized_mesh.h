// A decoder of quantized-mesh-1.0 (github.com/CesiumGS/quantized-mesh), independent of the encoder in proto.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "fly/content/tile_content.h"

namespace terrace::fly {

// Reads all of a tile: header, vertices, indices, edges and extensions. Safe for any input.
// kInvalidArgument names the first fault.
Result<TileContent> DecodeQuantizedMesh(std::string_view bytes);

}  // namespace terrace::fly

// A decoder of quantized-mesh-1.0 (github.com/CesiumGS/quantized-mesh), independent of the encoder in proto.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "fly/content/tile_content.h"

namespace terrace::fly {

// Reads all of a tile: header, vertices, indices, edges and extensions. kInvalidArgument names the first thing that is
// wrong; any bytes are safe.
Result<TileContent> DecodeQuantizedMesh(std::string_view bytes);

}  // namespace terrace::fly

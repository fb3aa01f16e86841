// A decoder of binary glTF tiles: plain, quantized, with Draco, or with meshopt (counted, not decoded).
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "fly/content/tile_content.h"

namespace terrace::fly {

// Decodes the meshes of a GLB (glTF 2.0; KHR_draco_mesh_compression by libdraco). Every index must name a vertex. The
// buffers of meshes with EXT_meshopt_compression are not decoded. Safe for any input. kInvalidArgument says what is
// wrong, kNotFound that fly has no reader for such a tile: a b3dm, a glTF in JSON.
Result<TileContent> DecodeGlb(std::string_view bytes);

}  // namespace terrace::fly

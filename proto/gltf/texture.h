// Pictures as the bytes of image files, for the textures of GLB tiles. Deterministic, thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "proto/gltf/gltf_types.h"

namespace terrace::proto {

// "image/jpeg", "image/webp". Precondition: not kNone.
std::string_view MediaTypeOf(TextureFormat format);

// `rgb`: 3 bytes a pixel, row by row from the top. Chroma has half the resolution. `quality`: 1 smallest .. 100 best,
// on the scale of the format's own library. kInternal: the library failed. Preconditions: sides from 1 to 16383, 3 *
// width * height bytes, a quality in its range, not kNone.
Result<std::string> EncodePicture(std::span<const std::uint8_t> rgb, int width, int height, TextureFormat format,
                                  int quality);

}  // namespace terrace::proto

// Pictures of map tiles as PNG (png.h), WebP and JPEG. Deterministic, thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "engine/core/result.h"
#include "proto/documents/picture_types.h"
#include "proto/documents/png.h"

namespace terrace::proto {

// "image/png", "image/webp", "image/jpeg".
const char* MediaTypeOf(PictureFormat format);
// As in URLs: "png", "webp", "jpg".
const char* ToString(PictureFormat format);

// The samples unchanged, as PNG or as lossless WebP. WebP stores grey as RGB, and no alpha if all pixels are opaque;
// colours of transparent pixels may change. kInternal: libwebp failed. Preconditions: those of EncodePng; `format` is
// not kJpeg.
Result<std::string> EncodeExactly(const PixelView& pixels, PictureFormat format);

// A photograph. PNG keeps it unchanged. WebP keeps alpha unchanged and colours at `quality`, 1 .. 100. JPEG has colours
// at `quality`, and `background` where pixels are transparent. Errors as above. Preconditions: those of EncodePng;
// `pixels` are kRgba.
Result<std::string> EncodePhoto(const PixelView& pixels, PictureFormat format, int quality,
                                const std::array<std::uint8_t, 3>& background);

}  // namespace terrace::proto

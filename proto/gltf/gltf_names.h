// Names of the enumerators of gltf_types.h in URLs, in the configuration and in files. Not installed.
#pragma once

#include "engine/core/names.h"
#include "proto/gltf/gltf_types.h"

namespace terrace::proto {

inline constexpr Names<GlbCompression, 4> kGlbCompressionNames = {{{"draco", GlbCompression::kDraco},
                                                                   {"none", GlbCompression::kNone},
                                                                   {"quantized", GlbCompression::kQuantized},
                                                                   {"meshopt", GlbCompression::kMeshopt}}};

inline constexpr Names<TextureFormat, 3> kTextureFormatNames = {
    {{"jpeg", TextureFormat::kJpeg}, {"webp", TextureFormat::kWebp}, {"none", TextureFormat::kNone}}};

}  // namespace terrace::proto

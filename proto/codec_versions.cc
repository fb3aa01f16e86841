#include "proto/codec_versions.h"

// clang-format off
#include <cstdio>  // jpeglib.h needs FILE
#include <jpeglib.h>
// clang-format on
#include <brotli/encode.h>
#include <draco/core/draco_version.h>
#include <fmt/format.h>
#include <libdeflate.h>
#include <meshoptimizer.h>
#include <webp/encode.h>
#include <zlib.h>
#include <zstd.h>

namespace terrace::proto {

std::string CodecVersions() {
  return fmt::format(
      "Draco {}, meshoptimizer {}, libjpeg {}, libwebp {:x}, libdeflate {}, zlib {}, brotli {:x}, zstd {}",
      draco::kDracoVersion, MESHOPTIMIZER_VERSION, JPEG_LIB_VERSION, WebPGetEncoderVersion(), LIBDEFLATE_VERSION_STRING,
      zlibVersion(), BrotliEncoderVersion(), ZSTD_versionString());
}

}  // namespace terrace::proto

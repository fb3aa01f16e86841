#include "tiler/encoder_version.h"

#include <fmt/format.h>

#include "engine/gdal/gdal_runtime.h"
#include "proto/codec_versions.h"

namespace terrace::tiler {

std::string EncoderText() {
  return fmt::format("encoder {}, {}, {}", kEncoderVersion, dem::GdalVersions(), proto::CodecVersions());
}

std::string VersionText(std::uint64_t generation) { return fmt::format("{:012x}", generation >> 16); }

bool IsVersionOf(std::string_view text, std::uint64_t generation) { return text == VersionText(generation); }

}  // namespace terrace::tiler

// The manifest as part of other JSON, and numbers in JSON. manifest.h declares ToJson and ParseManifest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "archive/manifest.h"
#include "engine/core/result.h"

namespace terrace::archive {

// JSON with the manifest as its member kManifestMember: metadata of an archive in one file.
inline constexpr const char* kManifestMember = "terrace";
// kInvalidArgument: the text is not a JSON object, has no such member, or has too many values.
Result<std::string> ManifestIn(std::string_view metadata);

// kInvalidArgument: ParseManifest and ManifestIn would refuse the text because of the number or depth of its values.
Result<void> CheckBounds(std::string_view json, std::size_t max_values = kMaxValues);

// The number that 16 hexadecimal digits state; nothing for any other text.
std::optional<std::uint64_t> ParseHex16(std::string_view text);

}  // namespace terrace::archive

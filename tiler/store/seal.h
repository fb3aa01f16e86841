// Values of a store with a checksum over key and value: what does not check out was not written for this key.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace terrace::tiler {

std::string Seal(std::string_view key, std::string value);

// The value within `sealed`; nothing if a bit of it, its length or its key is another one (but for one case in 2^64).
std::optional<std::string_view> Unseal(std::string_view key, std::string_view sealed);

}  // namespace terrace::tiler

// Values of a store with a checksum over key and value, so that a damaged or misplaced value is detected.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace terrace::tiler {

std::string Seal(std::string_view key, std::string value);

// The value within `sealed`, or nothing if its bits, length or key differ (with a probability of 1 - 2^-64).
std::optional<std::string_view> Unseal(std::string_view key, std::string_view sealed);

}  // namespace terrace::tiler

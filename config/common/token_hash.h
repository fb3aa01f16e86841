// Tokens and their hashes. The server stores only the hash, which gives no access.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace terrace::config {

// The minimum length of a token.
inline constexpr std::size_t kMinTokenBytes = 16;

// SHA-256 in 64 lower-case hexadecimal digits, as sha256sum prints it. Thread-safe.
std::string TokenHash(std::string_view token);

}  // namespace terrace::config

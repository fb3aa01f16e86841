// Hashes of tokens. The server stores only the hash, which gives no access.
#pragma once

#include <string>
#include <string_view>

namespace terrace::config {

// SHA-256 in 64 lower-case hexadecimal digits, as sha256sum prints it. Thread-safe.
std::string TokenHash(std::string_view token);

}  // namespace terrace::config

// gzip bodies (RFC 1952).
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::fly {

inline constexpr std::size_t kMaxBodyBytes = std::size_t{256} << 20;  // decoded; more is refused

bool IsGzip(std::string_view bytes);

// kInvalidArgument if the bytes are not one complete gzip stream, or decode to more than kMaxBodyBytes.
Result<std::string> Gunzip(std::string_view bytes);

}  // namespace terrace::fly

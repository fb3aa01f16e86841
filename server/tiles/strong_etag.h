// The ETag of bytes that the server made.
#pragma once

#include <string>
#include <string_view>

namespace terrace::server {

// Strong, with its quotes: a hash of 128 bits.
std::string StrongETag(std::string_view bytes);

}  // namespace terrace::server

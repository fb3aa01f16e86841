// Deterministic compression of response bodies and of what lies inside them.
#pragma once

#include <string>
#include <string_view>

namespace terrace::proto {

// RFC 1952 gzip with libdeflate: no time stamp, no name, so that equal bytes compress to equal bytes.
// Thread-safe. Precondition: 0 <= level <= 12; 0 stores, 12 is slowest and smallest.
std::string Gzip(std::string_view bytes, int level = 6);

// RFC 1950 zlib, as PNG holds it, on the same terms.
std::string Zlib(std::string_view bytes, int level = 6);

}  // namespace terrace::proto

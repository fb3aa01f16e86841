// Deterministic compression of response bodies and of what lies inside them.
#pragma once

#include <string>
#include <string_view>

namespace terrace::proto {

// RFC 1952 gzip with libdeflate: no time stamp, no name, so that equal bytes compress to equal bytes.
// Thread-safe. Precondition: 0 <= level <= 12; 0 stores, 12 is slowest and smallest.
std::string Gzip(std::string_view bytes, int level = 6);

// RFC 7932 brotli. Thread-safe. Precondition: 0 <= quality <= 11. From 5 on it takes twice the time of 4 and saves a
// thousandth.
std::string Brotli(std::string_view bytes, int quality = 4);

// RFC 8878 zstd, one frame, without a checksum. Thread-safe. Precondition: 1 <= level <= 19.
std::string Zstd(std::string_view bytes, int level = 6);

// RFC 1950 zlib, as PNG holds it, on the same terms.
std::string Zlib(std::string_view bytes, int level = 6);

}  // namespace terrace::proto

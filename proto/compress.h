// Deterministic compression of response bodies and of streams inside them.
//
// Up to kCompressedAtOnce bytes are compressed in one call. Larger texts are compressed in parts of kCompressedAtOnce,
// and the stop token is checked before each part. A function returns the empty text if a stop was requested.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

namespace terrace::proto {

// The levels take a tenth of a tile's build and reach most of the possible compression. Brotli takes twice the time
// from quality 5 on and saves a thousandth.
inline constexpr int kGzipLevel = 6, kBrotliQuality = 4, kZstdLevel = 6;
static_assert(kGzipLevel <= 9, "zlib has no more");

// Bytes that are compressed between two checks of the stop token: about ten milliseconds.
inline constexpr std::size_t kCompressedAtOnce = std::size_t{1} << 20;

// RFC 1952 gzip, one member, without time stamp and name, so that equal bytes compress to equal bytes. Uses libdeflate
// up to kCompressedAtOnce bytes, and zlib above, because libdeflate cannot be interrupted. Thread-safe.
std::string Gzip(std::string_view bytes, const std::stop_token& stop = {});

// Decompresses one member of gzip; its checksum must be right. Nothing: it is damaged, something follows it, or it is
// larger than `max_bytes`. Accepts any bytes. Thread-safe.
std::optional<std::string> Gunzip(std::string_view bytes, std::size_t max_bytes);

// The parts of a gzip member that zip files store as well: the deflated bytes, and the CRC-32 and length of the
// decompressed ones.
struct GzipMember {
  std::string_view deflated;  // within the member
  std::uint32_t crc32 = 0, size = 0;
};
// Nothing: not written by Gzip. Does not decompress the bytes, and therefore does not check them.
std::optional<GzipMember> SplitGzip(std::string_view gzip);

// CRC-32 as in gzip and zip. Thread-safe.
std::uint32_t Crc32(std::string_view bytes);

// RFC 7932 brotli. Thread-safe.
std::string Brotli(std::string_view bytes, const std::stop_token& stop = {});

// RFC 8878 zstd, one frame, without a checksum. Thread-safe.
std::string Zstd(std::string_view bytes, const std::stop_token& stop = {});

// RFC 1950 zlib, as in PNG, by libdeflate in one call, at kGzipLevel. Thread-safe.
std::string Zlib(std::string_view bytes);

}  // namespace terrace::proto

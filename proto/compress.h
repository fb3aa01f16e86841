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

// Default levels: they take a tenth of a tile's build and reach most of the possible compression.
inline constexpr int kGzipLevel = 6, kBrotliQuality = 4, kZstdLevel = 6;

// Takes about ten milliseconds.
inline constexpr std::size_t kCompressedAtOnce = std::size_t{1} << 20;

// RFC 1952 gzip, one member, without time stamp and name, so that equal bytes compress to equal bytes. Uses libdeflate
// up to kCompressedAtOnce bytes, and zlib above, because libdeflate cannot be interrupted. Thread-safe. Precondition: 0
// <= level <= 12; 0 stores, 12 is slowest and smallest (zlib's maximum is 9).
std::string Gzip(std::string_view bytes, int level = kGzipLevel, const std::stop_token& stop = {});

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

// RFC 7932 brotli. Thread-safe. Precondition: 2 <= quality <= 9. From 5 on it takes twice the time of 4 and saves a
// thousandth.
std::string Brotli(std::string_view bytes, int quality = kBrotliQuality, const std::stop_token& stop = {});

// RFC 8878 zstd, one frame, without a checksum. Thread-safe. Precondition: 1 <= level <= 19.
std::string Zstd(std::string_view bytes, int level = kZstdLevel, const std::stop_token& stop = {});

// RFC 1950 zlib, as in PNG, by libdeflate in one call. Thread-safe. Precondition: as for Gzip.
std::string Zlib(std::string_view bytes, int level = 6);

}  // namespace terrace::proto

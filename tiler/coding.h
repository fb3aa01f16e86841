// Content codings (RFC 9110, section 8.4.1) of reply bodies.
#pragma once

#include <array>
#include <cstdint>
#include <stop_token>
#include <string>
#include <string_view>

namespace terrace::tiler {

enum class Coding : std::uint8_t { kIdentity, kGzip, kBrotli, kZstd };

// What bodies that are made for a request may be compressed with, the smallest first: of 206 tiles (23 KB each) brotli
// leaves 63.3 %, gzip 65.8 % and zstd 66.0 %, in 0.39, 0.30 and 0.26 ms a tile.
inline constexpr std::array<Coding, 3> kCodings = {Coding::kBrotli, Coding::kGzip, Coding::kZstd};

// What bodies that are compressed once at the start come in.
inline constexpr std::array<Coding, 1> kGzipOnly = {Coding::kGzip};

// As Content-Encoding names it: "br". Empty for identity.
std::string_view NameOf(Coding coding);

// Deterministic: equal bytes are compressed to equal bytes. Empty, where `coding` is none of kIdentity, if a stop was
// requested (proto/compress.h).
std::string Compress(std::string bytes, Coding coding, const std::stop_token& stop = {});

}  // namespace terrace::tiler

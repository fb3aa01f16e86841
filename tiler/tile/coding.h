// Content codings (RFC 9110, section 8.4.1) of reply bodies.
#pragma once

#include <array>
#include <cstdint>
#include <stop_token>
#include <string>
#include <string_view>

namespace terrace::tiler {

enum class Coding : std::uint8_t { kIdentity, kGzip, kBrotli, kZstd };

// Codings of bodies that are built on request, in order of preference. Measured on 206 tiles of 23 KB: brotli 63.3 % of
// the size in 0.39 ms, gzip 65.8 % in 0.30 ms, zstd 66.0 % in 0.26 ms.
inline constexpr std::array<Coding, 3> kCodings = {Coding::kBrotli, Coding::kGzip, Coding::kZstd};

// Codings of documents that describe a dataset, such as layer.json, and of the files of the viewer.
inline constexpr std::array<Coding, 1> kGzipOnly = {Coding::kGzip};

// The name in Content-Encoding, such as "br"; empty for identity.
std::string_view NameOf(Coding coding);

// Deterministic: equal bytes give equal bytes. If a stop was requested, the result may be empty.
std::string Compress(std::string bytes, Coding coding, const std::stop_token& stop = {});

}  // namespace terrace::tiler

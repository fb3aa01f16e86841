#include "proto/compress.h"

#include <brotli/encode.h>
#include <libdeflate.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <new>

#include "engine/core/bytes.h"
#include "engine/core/check.h"

namespace terrace::proto {

namespace {

using Bound = std::size_t (*)(libdeflate_compressor*, std::size_t);
using Compress = std::size_t (*)(libdeflate_compressor*, const void*, std::size_t, void*, std::size_t);

std::string CompressWith(Bound bound, Compress compress, std::string_view bytes) {
  struct Free {
    void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
  };
  const std::unique_ptr<libdeflate_compressor, Free> compressor(libdeflate_alloc_compressor(kGzipLevel));
  if (compressor == nullptr) throw std::bad_alloc();  // the level is valid: only memory can be short
  std::string out(bound(compressor.get(), bytes.size()), '\0');
  const std::size_t size = compress(compressor.get(), bytes.data(), bytes.size(), out.data(), out.size());
  TERRACE_CHECK(size > 0);  // zero would mean that the bound was too small
  out.resize(size);
  return out;
}

// Passes `bytes` to `take` in pieces of kCompressedAtOnce, with a flag for the last one. Returns false if a stop was
// requested.
bool InPieces(std::string_view bytes, const std::stop_token& stop, const auto& take) {
  do {
    if (stop.stop_requested()) return false;
    const std::string_view piece = bytes.substr(0, kCompressedAtOnce);
    bytes.remove_prefix(piece.size());
    take(piece, bytes.empty());
  } while (!bytes.empty());
  return true;
}

std::string GzipByZlib(std::string_view bytes, const std::stop_token& stop) {
  constexpr int kGzipHeader = 16, kMemory = 8;
  z_stream stream{};
  if (::deflateInit2(&stream, kGzipLevel, Z_DEFLATED, kGzipHeader + MAX_WBITS, kMemory, Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::bad_alloc();  // the level is valid: only memory can be short
  }
  const std::unique_ptr<z_stream, int (*)(z_stream*)> owner(&stream, ::deflateEnd);
  std::string out;
  const bool is_done = InPieces(bytes, stop, [&](std::string_view piece, bool is_last) {
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(piece.data()));
    stream.avail_in = static_cast<uInt>(piece.size());
    do {
      std::array<char, 1 << 16> part;
      stream.next_out = reinterpret_cast<Bytef*>(part.data());
      stream.avail_out = part.size();
      TERRACE_CHECK(::deflate(&stream, is_last ? Z_FINISH : Z_NO_FLUSH) != Z_STREAM_ERROR);
      out.append(part.data(), part.size() - stream.avail_out);
    } while (stream.avail_out == 0);
  });
  return is_done ? out : "";
}

}  // namespace

std::string Gzip(std::string_view bytes, const std::stop_token& stop) {
  if (stop.stop_requested()) return {};
  if (bytes.size() > kCompressedAtOnce) return GzipByZlib(bytes, stop);
  return CompressWith(libdeflate_gzip_compress_bound, libdeflate_gzip_compress, bytes);
}

std::optional<std::string> Gunzip(std::string_view bytes, std::size_t max_bytes) {
  // The size modulo 2^32 is at the end. Deflate expands by at most 1,032: a wrong size does not cost memory.
  constexpr std::size_t kMinBytes = 18, kMaxFactor = 1032;
  if (bytes.size() < kMinBytes) return std::nullopt;
  std::uint32_t size = 0;
  std::memcpy(&size, bytes.data() + bytes.size() - sizeof(size), sizeof(size));
  if (size > max_bytes || size / kMaxFactor > bytes.size()) return std::nullopt;
  struct Free {
    void operator()(libdeflate_decompressor* decompressor) const { libdeflate_free_decompressor(decompressor); }
  };
  const std::unique_ptr<libdeflate_decompressor, Free> decompressor(libdeflate_alloc_decompressor());
  if (decompressor == nullptr) throw std::bad_alloc();
  std::string out(size, '\0');
  std::size_t read = 0, written = 0;
  const libdeflate_result result = libdeflate_gzip_decompress_ex(decompressor.get(), bytes.data(), bytes.size(),
                                                                 out.data(), out.size(), &read, &written);
  if (result != LIBDEFLATE_SUCCESS || read != bytes.size() || written != out.size()) return std::nullopt;
  return out;
}

// The result is equal to that of BrotliEncoderCompress, because blocks do not depend on the division of the input.
std::string Brotli(std::string_view bytes, const std::stop_token& stop) {
  if (bytes.empty()) return "\x06";
  const std::unique_ptr<BrotliEncoderState, void (*)(BrotliEncoderState*)> encoder(
      BrotliEncoderCreateInstance(nullptr, nullptr, nullptr), BrotliEncoderDestroyInstance);
  if (encoder == nullptr) throw std::bad_alloc();
  BrotliEncoderSetParameter(encoder.get(), BROTLI_PARAM_QUALITY, std::uint32_t{kBrotliQuality});
  BrotliEncoderSetParameter(encoder.get(), BROTLI_PARAM_SIZE_HINT,
                            static_cast<std::uint32_t>(std::min<std::size_t>(bytes.size(), 1 << 30)));
  std::string out(BrotliEncoderMaxCompressedSize(bytes.size()), '\0');
  std::size_t room = out.size();
  auto* to = reinterpret_cast<std::uint8_t*>(out.data());
  const bool is_done = InPieces(bytes, stop, [&](std::string_view piece, bool is_last) {
    std::size_t left = piece.size();
    const auto* from = reinterpret_cast<const std::uint8_t*>(piece.data());
    const auto operation = is_last ? BROTLI_OPERATION_FINISH : BROTLI_OPERATION_PROCESS;
    const auto taken = BrotliEncoderCompressStream(encoder.get(), operation, &left, &from, &room, &to, nullptr);
    if (taken != BROTLI_TRUE) throw std::bad_alloc();
    TERRACE_CHECK(left == 0);  // the bound is never too small
  });
  if (!is_done) return {};
  TERRACE_CHECK(BrotliEncoderIsFinished(encoder.get()) == BROTLI_TRUE);
  out.resize(out.size() - room);
  return out;
}

std::string Zstd(std::string_view bytes, const std::stop_token& stop) {
  const std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(), ZSTD_freeCCtx);
  if (context == nullptr) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kZstdLevel);
  ZSTD_CCtx_setPledgedSrcSize(context.get(), bytes.size());
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  ZSTD_outBuffer to{out.data(), out.size(), 0};
  const bool is_done = InPieces(bytes, stop, [&](std::string_view piece, bool is_last) {
    ZSTD_inBuffer from{piece.data(), piece.size(), 0};
    const auto mode = is_last ? ZSTD_e_end : ZSTD_e_continue;
    std::size_t left = 0;
    do {
      left = ZSTD_compressStream2(context.get(), &to, &from, mode);
      if (ZSTD_isError(left) != 0) throw std::bad_alloc();  // the bound is never too small
    } while (from.pos < from.size || (is_last && left > 0));
  });
  if (!is_done) return {};
  out.resize(to.pos);
  return out;
}

std::string Zlib(std::string_view bytes) {
  return CompressWith(libdeflate_zlib_compress_bound, libdeflate_zlib_compress, bytes);
}

std::optional<GzipMember> SplitGzip(std::string_view gzip) {
  constexpr std::size_t kHead = 10, kTail = 8;
  constexpr std::string_view kMagic("\x1f\x8b\x08\x00", 4);  // deflate, no optional fields
  if (gzip.size() < kHead + kTail || !gzip.starts_with(kMagic)) return std::nullopt;
  ByteReader tail(gzip.substr(gzip.size() - kTail));
  GzipMember member;
  member.deflated = gzip.substr(kHead, gzip.size() - kHead - kTail);
  member.crc32 = tail.Get<std::uint32_t>();
  member.size = tail.Get<std::uint32_t>();
  return member;
}

std::uint32_t Crc32(std::string_view bytes) { return libdeflate_crc32(0, bytes.data(), bytes.size()); }

}  // namespace terrace::proto

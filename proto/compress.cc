#include "proto/compress.h"

#include <brotli/encode.h>
#include <libdeflate.h>
#include <zstd.h>

#include <cstdint>
#include <memory>
#include <new>

#include "engine/core/check.h"

namespace terrace::proto {

namespace {

using Bound = std::size_t (*)(libdeflate_compressor*, std::size_t);
using Compress = std::size_t (*)(libdeflate_compressor*, const void*, std::size_t, void*, std::size_t);

std::string CompressWith(Bound bound, Compress compress, std::string_view bytes, int level) {
  struct Free {
    void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
  };
  const std::unique_ptr<libdeflate_compressor, Free> compressor(libdeflate_alloc_compressor(level));
  if (compressor == nullptr) throw std::bad_alloc();  // levels are those that there are
  std::string out(bound(compressor.get(), bytes.size()), '\0');
  const std::size_t size = compress(compressor.get(), bytes.data(), bytes.size(), out.data(), out.size());
  TERRACE_CHECK(size > 0);  // zero only if the bound were too small
  out.resize(size);
  return out;
}

}  // namespace

std::string Gzip(std::string_view bytes, int level) {
  return CompressWith(libdeflate_gzip_compress_bound, libdeflate_gzip_compress, bytes, level);
}

std::string Brotli(std::string_view bytes, int quality) {
  std::size_t size = BrotliEncoderMaxCompressedSize(bytes.size());
  TERRACE_CHECK(size > 0);  // zero only beyond 2^63
  std::string out(size, '\0');
  const auto done = BrotliEncoderCompress(quality, BROTLI_DEFAULT_WINDOW, BROTLI_MODE_GENERIC, bytes.size(),
                                          reinterpret_cast<const std::uint8_t*>(bytes.data()), &size,
                                          reinterpret_cast<std::uint8_t*>(out.data()));
  if (done != BROTLI_TRUE) throw std::bad_alloc();  // the bound is never too small
  out.resize(size);
  return out;
}

std::string Zstd(std::string_view bytes, int level) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), level);
  if (ZSTD_isError(size) != 0) throw std::bad_alloc();  // the bound is never too small
  out.resize(size);
  return out;
}

std::string Zlib(std::string_view bytes, int level) {
  return CompressWith(libdeflate_zlib_compress_bound, libdeflate_zlib_compress, bytes, level);
}

}  // namespace terrace::proto

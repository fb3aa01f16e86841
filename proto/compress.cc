#include "proto/compress.h"

#include <libdeflate.h>

#include <memory>

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
  TERRACE_CHECK(compressor != nullptr);  // no such level, or no memory
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

std::string Zlib(std::string_view bytes, int level) {
  return CompressWith(libdeflate_zlib_compress_bound, libdeflate_zlib_compress, bytes, level);
}

}  // namespace terrace::proto

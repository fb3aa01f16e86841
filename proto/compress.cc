#include "proto/compress.h"

#include <libdeflate.h>

#include <memory>

#include "engine/core/check.h"

namespace terrace::proto {

std::string Gzip(std::string_view bytes, int level) {
  struct Free {
    void operator()(libdeflate_compressor* compressor) const { libdeflate_free_compressor(compressor); }
  };
  const std::unique_ptr<libdeflate_compressor, Free> compressor(libdeflate_alloc_compressor(level));
  TERRACE_CHECK(compressor != nullptr);  // no such level, or no memory
  std::string out(libdeflate_gzip_compress_bound(compressor.get(), bytes.size()), '\0');
  const std::size_t size =
      libdeflate_gzip_compress(compressor.get(), bytes.data(), bytes.size(), out.data(), out.size());
  TERRACE_CHECK(size > 0);  // zero only if the bound were too small
  out.resize(size);
  return out;
}

}  // namespace terrace::proto

#include "fly/content/gunzip.h"

#include <libdeflate.h>

#include <algorithm>
#include <memory>

namespace terrace::fly {

bool IsGzip(std::string_view bytes) { return bytes.size() > 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b'; }

Result<std::string> Gunzip(std::string_view bytes) {
  const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> decompressor(
      libdeflate_alloc_decompressor(), &libdeflate_free_decompressor);
  if (!decompressor) return MakeError(ErrorCode::kUnavailable, "no memory to decompress a body");
  std::string out;
  // Not from the length at the end of the stream, which may be damaged.
  std::size_t capacity = std::clamp<std::size_t>(bytes.size() * 8, 4096, kMaxBodyBytes);
  for (;;) {
    out.resize(capacity);
    std::size_t read = 0, written = 0;
    const libdeflate_result result = libdeflate_gzip_decompress_ex(decompressor.get(), bytes.data(), bytes.size(),
                                                                   out.data(), out.size(), &read, &written);
    if (result == LIBDEFLATE_SUCCESS) {
      if (read < bytes.size()) return MakeError(ErrorCode::kInvalidArgument, "bytes follow the gzip stream");
      out.resize(written);
      return out;
    }
    if (result != LIBDEFLATE_INSUFFICIENT_SPACE) {
      return MakeError(ErrorCode::kInvalidArgument, "the gzip stream is damaged or cut off");
    }
    if (capacity == kMaxBodyBytes) {
      return MakeError(ErrorCode::kInvalidArgument, "the gzip stream decodes to more than {} bytes", kMaxBodyBytes);
    }
    capacity = std::min(capacity * 4, kMaxBodyBytes);
  }
}

}  // namespace terrace::fly

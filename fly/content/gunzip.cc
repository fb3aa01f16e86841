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
  // The length at the end of a stream is only a hint: it may be damaged.
  std::size_t capacity = std::clamp<std::size_t>(bytes.size() * 8, 4096, kMaxBodyBytes);
  for (;;) {
    out.resize(capacity);
    std::size_t written = 0;
    const libdeflate_result result =
        libdeflate_gzip_decompress(decompressor.get(), bytes.data(), bytes.size(), out.data(), out.size(), &written);
    if (result == LIBDEFLATE_SUCCESS) {
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

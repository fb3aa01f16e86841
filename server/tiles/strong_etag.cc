#include "server/tiles/strong_etag.h"

#include <fmt/format.h>
#include <xxhash.h>

namespace terrace::server {

std::string StrongETag(std::string_view bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return fmt::format("\"{:016x}{:016x}\"", hash.high64, hash.low64);
}

}  // namespace terrace::server

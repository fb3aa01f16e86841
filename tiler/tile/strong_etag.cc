#include "tiler/tile/strong_etag.h"

#include <fmt/format.h>
#include <xxhash.h>

#include "tiler/tile/build_id.h"

namespace terrace::tiler {

std::string StrongETag(std::string_view bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return fmt::format("\"{:016x}{:016x}\"", hash.high64, hash.low64);
}

std::string RequestETag(std::string_view kind, std::string_view dataset, std::uint64_t generation,
                        std::string_view query, Coding coding) {
  return StrongETag(fmt::format("{} {} {:016x} {:016x} {} {}", kind, dataset, generation, BuildId(),
                                static_cast<int>(coding), query));
}

}  // namespace terrace::tiler

// What a cache in memory holds, and how often it was asked.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrace::tiler {

struct CacheStats {
  std::size_t entries = 0;
  std::size_t bytes = 0;  // of the values, and what the cache itself needs for them
  std::uint64_t hits = 0, misses = 0;
};

}  // namespace terrace::tiler

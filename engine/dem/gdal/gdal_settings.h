// Process-wide settings and counters of GDAL. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>

namespace terrace::dem {

// GDAL's counts since the start, in all threads; for metrics.
struct GdalCounts {
  std::uint64_t errors = 0, warnings = 0;
  std::uint64_t cache_bytes = 0;  // current size of the block cache
};
GdalCounts CountGdalErrors();

// Sets the size of GDAL's block cache, for all threads together.
void SetGdalCache(std::size_t bytes);

// Sets how many idle source files of all datasets (rasters, images, PROJ grids) stay open. Files in use do not count;
// there is at most one per thread. `vrt_parts`: how many parts of VRTs GDAL keeps open, in use or idle; 2 to 1000. The
// defaults are 256 and 100. Call before the first source is opened.
void SetOpenSources(std::size_t idle, std::size_t vrt_parts);

}  // namespace terrace::dem

// What a process sets and counts of GDAL as a whole. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace terrace::dem {

// Of GDAL, since the start, in all threads; for metrics.
struct GdalCounts {
  std::uint64_t errors = 0, warnings = 0;
  std::uint64_t cache_bytes = 0;  // of blocks, now
};
GdalCounts CountGdalErrors();

// "GDAL 3.6.2, PROJ 9.1.1": those in use. Another version of one may read or place samples otherwise.
std::string LibraryVersions();

// How much memory blocks of rasters may take, in all threads together.
void SetGdalCache(std::size_t bytes);

// How many files of sources are kept open between reads, those of all datasets together: rasters, images, grids of
// PROJ. What is in use comes on top, one a thread. `vrt_parts`: how many parts of VRTs GDAL keeps open, in use or not;
// 2 to 1000. Until the first call 256 and 100. Before the first source is opened.
void SetOpenSources(std::size_t idle, std::size_t vrt_parts);

}  // namespace terrace::dem

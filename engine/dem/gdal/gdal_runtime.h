// The process-wide state of GDAL: drivers, settings that must hold before the first file is opened, and a silent error
// handler. Nothing here writes to stderr or to the network.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrace::dem {

// Registers drivers and settles the configuration, once per process. Thread-safe; cheap when done.
void InitGdal();

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

// Closes GDAL's doors to the network, other processes' output and whatever else its file names reach beyond files.
// File systems of GDAL that are not local ("/vsicurl/", "/vsis3/" and their kin) answer every name with "no such file",
// but for those that an allowed prefix begins with, and so do names within names. Not thread-safe: before sources are
// opened.
void GuardNetwork(const std::vector<std::string>& allowed_prefixes);

// The last error of GDAL or PROJ on this thread since the previous call; "no further detail" if there was none. Call
// ForgetGdalError before library calls that can fail, so that an older message is not reported for a newer error.
std::string TakeGdalError();
void ForgetGdalError();

}  // namespace terrace::dem

// The process-wide state of GDAL: drivers, settings that must hold before the first file is opened, and a silent error
// handler. Nothing here writes to stderr or to the network.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace terrace::dem {

// Registers drivers and sets GDAL's configuration, once per process. Thread-safe; later calls are cheap.
void InitGdal();

// For metrics: errors and warnings since the start, in all threads, and the bytes in GDAL's cache of blocks now.
struct GdalCounts {
  std::uint64_t errors = 0, warnings = 0;
  std::uint64_t cache_bytes = 0;
};
GdalCounts ReadGdalCounts();

// The versions in use: "GDAL 3.6.2, PROJ 9.1.1". Other versions may read or locate samples differently.
std::string GdalVersions();

// Sets the size of GDAL's block cache, for all threads together.
void SetGdalCache(std::size_t bytes);

// Sets how many idle source files of all datasets (rasters, images, PROJ grids) stay open. Files in use do not count;
// there is at most one per thread. `vrt_parts`: how many parts of VRTs GDAL keeps open, in use or idle; 2 to 1000. The
// defaults are 256 and 100. Call before the first source is opened.
void SetOpenSources(std::size_t idle, std::size_t vrt_parts);

// Blocks GDAL's virtual file systems that read the network, the output of other processes, or anything else but files.
// Makes GDAL's remote file systems ("/vsicurl/", "/vsis3/" and similar) answer "no such file" for every name, also for
// names nested in other names. File systems named at the beginning of an allowed prefix stay available. Not
// thread-safe: call before sources are opened.
void GuardNetwork(const std::vector<std::string>& allowed_prefixes);

// The last error of GDAL or PROJ on this thread since the previous call; "no further detail" if there was none. Call
// ForgetGdalError before library calls that can fail, so that an older message is not reported for a newer error.
std::string TakeGdalError();
void ForgetGdalError();
// Whether TakeGdalError would return an error.
bool HasGdalError();

// The first warnings of GDAL on this thread since the previous call, each once, at most eight.
std::vector<std::string> TakeGdalWarnings();

}  // namespace terrace::dem

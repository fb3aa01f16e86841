// Blocks GDAL's virtual file systems for the network, for output of other processes, and for anything else but files.
#pragma once

#include <string>
#include <vector>

namespace terrace::dem {

// Makes GDAL's remote file systems ("/vsicurl/", "/vsis3/" and similar) answer "no such file" for every name, also for
// names nested in other names. File systems named at the beginning of an allowed prefix stay available. Not
// thread-safe: call before sources are opened.
void GuardNetwork(const std::vector<std::string>& allowed_prefixes);

}  // namespace terrace::dem

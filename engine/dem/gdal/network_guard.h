// Closes GDAL's doors to the network, other processes' output and whatever else its file names reach beyond files.
#pragma once

#include <string>
#include <vector>

namespace terrace::dem {

// File systems of GDAL that are not local ("/vsicurl/", "/vsis3/" and their kin) answer every name with "no such file",
// but for those that an allowed prefix begins with, and so do names within names. Not thread-safe: before sources are
// opened.
void GuardNetwork(const std::vector<std::string>& allowed_prefixes);

}  // namespace terrace::dem

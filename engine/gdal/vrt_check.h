// Checks VRT files by parsing their XML before GDAL does.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// Whether GDAL would open the file as a VRT, whatever its name is.
bool LooksLikeVrt(const std::string& path);

// Accepts only plain mosaics of files: no elements that compute, warp or set options, and only files that
// CheckSourceName allows. Without data roots, the files must lie below the VRT's folder. Remote files must be GeoTIFFs.
// For a symbolic link its target counts, also as the place that names are relative to.
Result<void> CheckVrt(const std::string& path);

// Returns the names of all files that a VRT refers to, directly or through nested VRTs; GDAL lists only the direct
// ones. For a VRT that CheckVrt refuses, the list may be incomplete.
std::vector<std::string> PartsOfVrt(const std::string& path);

}  // namespace terrace::dem

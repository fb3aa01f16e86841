// What a VRT leads to, found by reading its XML before GDAL does.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// Whether GDAL would take the file for a VRT, whatever its name.
bool LooksLikeVrt(const std::string& path);

// Allows plain mosaics of files, and nothing that computes, warps or takes options: every element is known, and every
// file that is named is one that CheckSourceName allows. Without data roots files must lie below the VRT's own folder.
Result<void> CheckVrt(const std::string& path);

// The names of all files that a VRT leads to, those of VRTs within it too: GDAL lists the outermost ones alone. Of one
// that CheckVrt does not allow, as far as it goes.
std::vector<std::string> PartsOfVrt(const std::string& path);

}  // namespace terrace::dem

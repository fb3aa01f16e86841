// What a VRT leads to, found by reading its XML before GDAL does.
#pragma once

#include <string>

#include "engine/core/result.h"

namespace terrace::dem {

// Whether GDAL would take the file for a VRT, whatever its name.
bool LooksLikeVrt(const std::string& path);

// Allows plain mosaics of files, and nothing that computes, warps or takes options: every element is known, and every
// file that is named is one that CheckSourceName allows. Without data roots files must lie below the VRT's own folder.
Result<void> CheckVrt(const std::string& path);

}  // namespace terrace::dem

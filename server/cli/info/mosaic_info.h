// What `terrace info` tells of rasters that make one dataset.
#pragma once

#include <string>

#include "engine/dem/dem_source.h"

namespace terrace::cli {

std::string TextOfBounds(const dem::GeoBounds& bounds);

void PrintMosaic(const std::string& name, const dem::DemInfo& info);
// One JSON object, as text.
std::string MosaicJson(const std::string& name, const dem::DemInfo& info);

}  // namespace terrace::cli

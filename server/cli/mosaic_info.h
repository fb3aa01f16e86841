// What `terrace info` tells of rasters that make one dataset.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "engine/dem/dem_source.h"

namespace terrace::cli {

void PrintMosaic(const std::string& name, const dem::DemInfo& info);
nlohmann::json MosaicJson(const std::string& name, const dem::DemInfo& info);

}  // namespace terrace::cli

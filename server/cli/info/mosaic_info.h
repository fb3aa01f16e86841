// Output of `terrace info` for rasters that form one dataset.
#pragma once

#include <string>

#include "engine/dem/elevation_model.h"

namespace terrace::cli {

std::string TextOfBounds(const dem::GeoBounds& bounds);

// Whether shallow tiles of the raster would read too many samples, if its averages were not kept.
bool IsLargeWithoutOverviews(const dem::RasterInfo& info);

void PrintMosaic(const std::string& name, const dem::DemInfo& info);
// The same as the text of a JSON object.
std::string MosaicJson(const std::string& name, const dem::DemInfo& info);

}  // namespace terrace::cli

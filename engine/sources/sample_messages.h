// What people should know about the samples of a raster, each with the remedy.
#pragma once

#include <string>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/gdal/sample_rules.h"

namespace terrace::dem {

// kInvalidArgument: by the scale of the band no sample has a height.
Result<void> CheckScale(const SampleRules& rules, const std::string& path);

// Doubts about heights in metres that no land or sea floor has, for example if they are in centimetres without a stated
// unit; empty: none.
std::string DoubtsOf(const HeightRange& heights);

// Of a raster without a valid sample.
std::string DescribeLackOfHeights(const SampleRules& rules, const std::string& path);

}  // namespace terrace::dem

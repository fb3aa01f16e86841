// What a dataset shows besides its heights: water and imagery.
#pragma once

#include <string>

#include "config/config.h"
#include "engine/core/result.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {

// Opens the water mask and the image that `wanted` names and puts them into `dataset`. Errors name the file and the
// remedy. Precondition: the dataset has its source.
Result<void> OpenLayers(const config::DatasetConfig& wanted, tiler::Dataset& dataset);

// Changes whenever what they add to the bytes of tiles does: part of the dataset's generation.
std::string LayersFingerprint(const tiler::Dataset& dataset);

}  // namespace terrace::cli

// The options `water` and `imagery` of a dataset: objects with keys of their own. Used inside this room only.
#pragma once

#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// {"mask": "water.tif"} or {"sea_level": 0}. As a flag a number is a sea level and everything else the path of a mask.
Codec<DatasetConfig> WaterCodec();

// {"image": "photo.tif", "attribution": ..., ...}. As a flag the path alone.
Codec<DatasetConfig> ImageryCodec();

const std::vector<Option<ImageryConfig>>& ImageryOptionTable();

}  // namespace terrace::config

// The options `water` and `imagery` of a dataset: objects with their own keys. For this module only.
#pragma once

#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// {"mask": "water.tif"} or {"sea_level": 0}. As a flag: a number is a sea level, any other text the path of a mask.
Codec<DatasetConfig> WaterCodec();

// {"image": "photo.tif", "attribution": ..., ...}. As a flag: only the path.
Codec<DatasetConfig> ImageryCodec();

const std::vector<Option<ImageryConfig>>& ImageryOptionTable();

}  // namespace terrace::config

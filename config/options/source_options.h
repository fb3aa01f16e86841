// The options `sources`, `vertical` and `nodata` of a dataset, and those that say which sources may be opened. Used
// inside this room only.
#pragma once

#include <string>
#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// ["dem.tif", {"path": "other.tif", "vertical": "egm96"}]
Codec<DatasetConfig> SourcesCodec();

// Of an entry that is an object.
const std::vector<Option<SourceConfig>>& SourceOptionTable();

// "crs", "unknown", "ellipsoid", "egm96", "egm2008", "EPSG:5703", or the path of a grid.
Codec<DatasetConfig> VerticalCodec();

// "auto", "declared", a number or a list of numbers.
Codec<DatasetConfig> NodataCodec();

// A list of texts. `is_path`: they are paths, relative to the folder of the file. As a flag: texts with commas between
// them.
Codec<Config> TextList(std::vector<std::string> Config::*member, const char* expected, bool is_path);

}  // namespace terrace::config

// The options `sources`, `vertical` and `nodata` of a dataset, and the options that restrict sources. For this module
// only.
#pragma once

#include <string>
#include <vector>

#include "config/options/option_table.h"

namespace terrace::config {

// ["dem.tif", {"path": "other.tif", "vertical": "egm96"}]
Codec<DatasetConfig> SourcesCodec();

// The options of an entry that is an object.
const std::vector<Option<SourceConfig>>& SourceOptionTable();

// "crs", "unknown", "ellipsoid", "egm96", "egm2008", "EPSG:5703", or the path of a grid.
Codec<DatasetConfig> VerticalCodec();

// "auto", "declared", a number or a list of numbers.
Codec<DatasetConfig> NodataCodec();

// A list of texts. `is_path`: the texts are paths, relative to the folder of the file. As a flag: texts separated by
// commas.
Codec<Config> TextList(std::vector<std::string> Config::*member, const char* expected, bool is_path);

}  // namespace terrace::config

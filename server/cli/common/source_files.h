// The files that a dataset names: what messages call them, and whether they may be read.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"

namespace terrace::cli {

std::size_t FileCount(const std::vector<config::SourceConfig>& sources);

// For messages: "alps.tif", "alps.tif and 2 more sources".
std::string NameOf(const std::vector<config::SourceConfig>& sources);

// Whether the dataset's files on this machine exist and may be read, without opening them: masks and images as well.
// The error names the first that may not.
Result<void> TryReading(const config::DatasetConfig& dataset);
// The same by the policy of sources (dem::SetSourcePolicy) that is in force.
Result<void> TryPolicy(const config::DatasetConfig& dataset);

}  // namespace terrace::cli

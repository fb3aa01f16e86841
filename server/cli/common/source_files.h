// The files of a dataset: their names in messages, and checks that they can be read.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"

namespace terrace::cli {

// The name of a dataset, from the file or folder on the command line. Folder names keep what looks like an extension.
std::string DatasetNameOf(const std::string& dem);

std::size_t FileCount(const std::vector<config::SourceConfig>& sources);

// For messages: "alps.tif", "alps.tif and 2 more sources".
std::string NameOf(const std::vector<config::SourceConfig>& sources);
// The same for a dataset; if it has no sources, the name of its archive.
std::string NameOf(const config::DatasetConfig& dataset);

// Checks that all local files of the dataset, including masks and images, exist and are readable, without opening them.
// The error names the first one that is not.
Result<void> CheckReadable(const config::DatasetConfig& dataset);
// Checks that the edits of a served dataset, which are watched and read again, are regular files. Opening a pipe
// without a writer would wait forever.
Result<void> CheckEditFiles(const config::DatasetConfig& dataset);
// Checks that the source policy in force (dem::SetSourcePolicy) allows all files of the dataset.
Result<void> CheckSourcePolicy(const config::DatasetConfig& dataset);

}  // namespace terrace::cli

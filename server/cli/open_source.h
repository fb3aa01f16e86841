// The elevation of a dataset, as its configuration names it.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"
#include "engine/dem/dem_source.h"

namespace terrace::cli {

// All files of the sources, each entry one rank.
std::vector<dem::DemFile> FilesOf(const config::DatasetConfig& dataset);
std::size_t FileCount(const std::vector<config::SourceConfig>& sources);

// For messages: "alps.tif", "alps.tif and 2 more sources".
std::string NameOf(const std::vector<config::SourceConfig>& sources);

// Whether the dataset's files on this machine are there and may be read, told without opening them: masks and images
// as well. The error names the first that may not.
Result<void> TryReading(const config::DatasetConfig& dataset);
// The same by the policy of sources (dem::SetSourcePolicy) that is in force.
Result<void> TryPolicy(const config::DatasetConfig& dataset);

// Opens and scans all of them; what is learnt is kept in `cache_dir`, if it is not empty. Errors name the file and the
// remedy. `fault`: dem::DemOptions.
Result<std::unique_ptr<dem::DemSource>> OpenSource(const config::DatasetConfig& wanted, const std::string& cache_dir,
                                                   const std::function<void(double)>& progress,
                                                   std::stop_token stop = {},
                                                   std::function<void(const Error&)> fault = {});

}  // namespace terrace::cli

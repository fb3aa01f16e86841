// The options of the configuration, for flags of the command line and their help.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"

namespace terrace::config {

// "--cache-bytes" of "cache_bytes".
std::string FlagOf(std::string_view key);

struct OptionInfo {
  std::string_view key;    // in the JSON file: "cache_bytes"
  std::string_view value;  // word for the value in help texts: "BYTES"
  std::string_view help;   // one line
  bool has_flag = false;
  std::string default_value;          // as JSON; empty: none
  std::string_view other_words = {};  // names that other programs use (engine/core/nearest_name.h)

  // "--cache-bytes"
  std::string Flag() const;
};

// Options at the top level of the file; options of a dataset.
std::vector<OptionInfo> ServerOptionInfos();
std::vector<OptionInfo> DatasetOptionInfos();

// Whether a change of this option at the top level of the file needs a restart.
bool NeedsRestart(std::string_view key);

// Returns the keys of options at the top level of the file whose values differ between two configurations.
std::vector<std::string> ChangedServerOptions(const Config& a, const Config& b);
// The same for the options of two datasets.
std::vector<std::string> ChangedDatasetOptions(const DatasetConfig& a, const DatasetConfig& b);

// Returns the options of the server that have no effect because another option lacks what they need; options with their
// default value are left out. The path is the key, or that of the object and the key: "shared_cache.ca_file".
std::vector<ConfigError> FindUnusedOptions(const Config& config);

// Sets the option `key` from the text of its flag. Appends errors to `errors`, with the flag as path. `directory`: as
// for FromWorkingDirectory; empty: relative paths are errors. Precondition: the option exists and has a flag.
void SetServerOption(std::string_view key, const std::string& text, const std::filesystem::path& directory,
                     Config& config, std::vector<ConfigError>& errors);
void SetDatasetOption(std::string_view key, const std::string& text, const std::filesystem::path& directory,
                      DatasetConfig& dataset, std::vector<ConfigError>& errors);

}  // namespace terrace::config

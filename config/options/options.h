// The options of the configuration one by one: for the command line, where each of them is a flag, and for its help.
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
  std::string_view value;  // what stands for the value in help texts: "BYTES"
  std::string_view help;   // one line
  bool has_flag = false;
  std::string default_value;          // as JSON; empty: there is none
  std::string_view other_words = {};  // what others call it (config/common/nearest_name.h)

  // "--cache-bytes"
  std::string Flag() const;
};

// Options at the top of the file, and options of one dataset.
std::vector<OptionInfo> ServerOptions();
std::vector<OptionInfo> DatasetOptions();

// Whether a change of this option at the top of the file waits for a restart.
bool TakesRestart(std::string_view key);

// The keys of the options at the top of the file whose values differ.
std::vector<std::string> ChangedServerOptions(const Config& a, const Config& b);

// Sets the option `key` from the text of its flag. What is wrong is appended to `errors`, with the flag as its path.
// `directory` is what FromWorkingDirectory takes; where it is empty, relative paths are errors.
// Precondition: the option exists and has a flag.
void SetServerOption(std::string_view key, const std::string& text, const std::filesystem::path& directory,
                     Config& config, std::vector<ConfigError>& errors);
void SetDatasetOption(std::string_view key, const std::string& text, const std::filesystem::path& directory,
                      DatasetConfig& dataset, std::vector<ConfigError>& errors);

}  // namespace terrace::config

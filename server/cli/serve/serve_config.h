// The arguments of terrace serve, and the configuration that they make.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "config/config.h"

namespace terrace::cli {

struct ServeArguments {
  std::filesystem::path directory;  // the working directory at the start; empty: it has no name
  std::vector<std::string> dems;
  std::string config_file, config_path;  // as given; absolute
  bool print_config = false, check_config = false;
  std::map<std::string, std::string> server_flags, dataset_flags;  // by option key
};

// A file that can be read only once, or endlessly.
bool IsPipe(const std::string& path);

// Applies the file's options, then the flags, then adds a dataset per DEM of the command line. Collects all errors.
config::Config MakeConfig(const ServeArguments& arguments, std::vector<config::ConfigError>& errors);

}  // namespace terrace::cli

// Adds options of the configuration as flags of a command.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "config/options/options.h"

namespace CLI {
class App;
}

namespace terrace::cli {

// Adds a flag for each option that has one. Stores its text in `values` by the option's key. The text is checked later
// by config::SetServerOption or config::SetDatasetOption, after the file has been read. `values` must outlive the
// command.
void AddFlags(CLI::App& command, const std::vector<config::OptionInfo>& options, const std::string& group,
              std::map<std::string, std::string>& values);

}  // namespace terrace::cli

// Options of the configuration as flags of a command.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "config/options/options.h"

namespace CLI {
class App;
}

namespace terrace::cli {

// A flag for each option that has one. Its text is kept in `values`, by the option's key: it is checked when it is set
// (config::SetServerOption, config::SetDatasetOption), after a file has been read. `values` must outlive the command.
void AddFlags(CLI::App& command, const std::vector<config::OptionInfo>& options, const std::string& group,
              std::map<std::string, std::string>& values);

}  // namespace terrace::cli

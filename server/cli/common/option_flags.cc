#include "server/cli/common/option_flags.h"

#include <CLI/CLI.hpp>

namespace terrace::cli {

void AddFlags(CLI::App& command, const std::vector<config::OptionInfo>& options, const std::string& group,
              std::map<std::string, std::string>& values) {
  for (const config::OptionInfo& option : options) {
    if (!option.has_flag) continue;
    const std::string key(option.key);
    std::string help(option.help);
    if (!option.default_value.empty()) help += " [" + option.default_value + "]";
    command
        .add_option_function<std::string>(
            option.Flag(), [&values, key](const std::string& text) { values[key] = text; }, help)
        ->type_name(std::string(option.value))
        ->group(group);
  }
}

}  // namespace terrace::cli

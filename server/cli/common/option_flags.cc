#include "server/cli/common/option_flags.h"

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

namespace terrace::cli {
namespace {

// The default in the flag's notation, without the quotes of JSON.
std::string ShownDefault(const config::OptionInfo& option) {
  std::string text = option.default_value;
  std::erase_if(text, [](char c) { return c == '"' || c == '[' || c == ']'; });
  constexpr std::uint64_t kMebibyte = std::uint64_t{1} << 20;
  const std::uint64_t bytes = option.value == "BYTES" ? std::stoull(text) : 0;
  return bytes >= kMebibyte && bytes % kMebibyte == 0 ? std::to_string(bytes / kMebibyte) + "MiB" : text;
}

}  // namespace

void AddFlags(CLI::App& command, const std::vector<config::OptionInfo>& options, const std::string& group,
              std::map<std::string, std::string>& values) {
  for (const config::OptionInfo& option : options) {
    if (!option.has_flag) continue;
    const std::string key(option.key);
    command
        .add_option_function<std::string>(
            option.Flag(), [&values, key](const std::string& text) { values[key] = text; }, std::string(option.help))
        ->default_str(ShownDefault(option))
        ->type_name(std::string(option.value))
        ->group(group);
  }
}

}  // namespace terrace::cli

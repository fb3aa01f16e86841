#include "server/cli/common/usage_error.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <map>
#include <string_view>
#include <system_error>

#include "config/options/options.h"
#include "engine/core/nearest_name.h"

namespace terrace::cli {
namespace {

std::string ExplainCommand(const CLI::App& program, const std::string& word) {
  std::vector<KnownName> known;
  for (const CLI::App* command : program.get_subcommands({})) known.push_back({command->get_name()});
  std::vector<std::string> meant;
  for (const std::string_view name : NearestNames(word, known)) meant.emplace_back(name);
  std::error_code ignored;
  if (meant.empty() && std::filesystem::exists(word, ignored)) meant.push_back("terrace serve " + word);
  return "unknown command " + word + DidYouMean(meant);
}

// Names that other programs use for options of the configuration, by flag.
std::map<std::string, std::string_view> OtherWords() {
  std::map<std::string, std::string_view> words;
  for (const auto& options : {config::ServerOptionInfos(), config::DatasetOptionInfos()}) {
    for (const config::OptionInfo& option : options) words.emplace(option.Flag(), option.other_words);
  }
  return words;
}

// "--listen HOST:PORT"
std::string WithValue(const CLI::Option& option, std::string_view flag) {
  const std::string value = option.get_items_expected_max() == 0 ? "" : option.get_type_name();
  return fmt::format("{}{}{}", flag, value.empty() ? "" : " ", value);
}

std::vector<std::string> NearestFlags(const CLI::App& command, const std::string& flag) {
  const std::map<std::string, std::string_view> other_words = OtherWords();
  std::map<std::string, const CLI::Option*> options;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) options.emplace("--" + name, option);
  }
  std::vector<KnownName> known;
  for (const auto& [name, option] : options) {
    const auto words = other_words.find(name);
    known.push_back({name, words == other_words.end() ? std::string_view() : words->second});
  }
  std::vector<std::string> nearest;
  for (const std::string_view name : NearestNames(flag, known)) {
    nearest.push_back(WithValue(*options.at(std::string(name)), name));
  }
  return nearest;
}

// The configuration key that corresponds to this flag; empty: there is no such key.
std::string_view KeyWithoutFlag(const std::string& flag) {
  for (const auto& options : {config::ServerOptionInfos(), config::DatasetOptionInfos()}) {
    for (const config::OptionInfo& option : options) {
      if (!option.has_flag && option.Flag() == flag) return option.key;
    }
  }
  return {};
}

// `command`: the command whose argument it is; the program for arguments before the command.
std::string ExplainFlag(const CLI::App& command, const CLI::App& program, const std::string& flag) {
  const std::string unknown = "unknown option " + flag;
  std::vector<const CLI::App*> others;
  for (const CLI::App* other : program.get_subcommands({})) {
    if (other != &command) others.push_back(other);
  }
  const auto meant = NearestFlags(command, flag);
  for (const CLI::App* other : others) {
    if (!meant.empty() || other->get_option_no_throw(flag) == nullptr) continue;
    return fmt::format("{}{}; it is one of 'terrace {}'", unknown, &command == &program ? " before the command" : "",
                       other->get_name());
  }
  if (const std::string_view key = KeyWithoutFlag(flag); !key.empty()) {
    return fmt::format("{}; \"{}\" stands in the configuration alone (terrace serve --config FILE)", unknown, key);
  }
  if (!meant.empty()) return unknown + DidYouMean(meant);
  std::vector<std::string> elsewhere;
  for (const CLI::App* other : others) {
    const std::vector<std::string> theirs = NearestFlags(*other, flag);
    if (!theirs.empty()) {
      elsewhere.push_back(fmt::format("{} of 'terrace {}'", Alternatives(theirs), other->get_name()));
    }
  }
  return unknown + DidYouMean(elsewhere);
}

// "-5" is a number.
bool IsFlag(const std::string& word) {
  return word.size() > 1 && word.front() == '-' && (word[1] < '0' || word[1] > '9') && word[1] != '.';
}

// "--listen: 1 required HOST:PORT missing", "--listen: At Most 1 required but received 2"
std::string ExplainMismatch(const CLI::App& command, const std::string& what) {
  const std::string flag = what.substr(0, what.find(':'));
  const CLI::Option* const option = command.get_option_no_throw(flag);
  if (option == nullptr) return what;
  if (what.find("received") != std::string::npos) return flag + " is given more than once";
  return fmt::format("{} needs a value: {}", flag, WithValue(*option, flag));
}

}  // namespace

bool HasUnknownCommand(const CLI::App& program, const std::vector<std::string>& arguments) {
  if (arguments.empty() || arguments.front().starts_with('-')) return false;
  return std::ranges::none_of(program.get_subcommands({}),
                              [&](const CLI::App* command) { return command->get_name() == arguments.front(); });
}

std::string ExplainUsage(const CLI::App& program, const CLI::ParseError& error,
                         const std::vector<std::string>& arguments) {
  const std::vector<CLI::App*> chosen = program.get_subcommands();
  const CLI::App& command = chosen.empty() ? program : *chosen.front();
  const auto explain = [&](const CLI::App& parsed_by, const std::string& word) {
    return ExplainFlag(parsed_by, program, word.substr(0, word.find('=')));
  };
  if (HasUnknownCommand(program, arguments)) return ExplainCommand(program, arguments.front());
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && chosen.empty()) {
    return explain(program, arguments.front());
  }
  // A mistyped option is often reported as missing, too.
  for (const CLI::App* parsed_by : {&program, &command}) {
    for (const std::string& word : parsed_by->remaining()) {
      if (IsFlag(word)) return explain(*parsed_by, word);
    }
  }
  if (const std::vector<std::string> words = command.remaining(); !words.empty()) {
    return fmt::format("{} is one argument too many", words.front());
  }
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) return ExplainMismatch(command, error.what());
  const std::string what = error.what();
  // "Could not convert: --flag = value"
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) return what.substr(0, what.find(" = "));
  return what;
}

std::string ExplainMissingValue(const CLI::App& program, const std::vector<std::string>& arguments) {
  const CLI::App* command = &program;
  const auto words = OtherWords();  // by the flags of the configuration
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& flag = arguments[i];
    const auto named = command->get_subcommands([&](const CLI::App* of) { return of->get_name() == flag; });
    if (!named.empty()) command = named.front();
    if (!IsFlag(flag) || i + 1 == arguments.size()) continue;
    const CLI::Option* const option = command->get_option_no_throw(flag);
    if (option == nullptr || option->get_items_expected_max() == 0) continue;
    const std::string& value = arguments[i + 1];
    if (value.empty() && (flag == "--config" || !words.contains(flag))) {
      return "the argument after " + flag + " is empty; leave it out, or set the variable that it comes from";
    }
    const std::string name = value.substr(0, value.find('='));
    if (IsFlag(value) && command->get_option_no_throw(name) != nullptr) {
      return fmt::format("{} needs a value: {}; the option {} follows", flag, WithValue(*option, flag), name);
    }
    ++i;  // a value may look like a flag
  }
  return {};
}

}  // namespace terrace::cli

// Messages for wrong command lines, with suggestions.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace terrace::cli {

// Whether the first argument that should be a command is not one. False if help is requested.
bool HasUnknownCommand(const CLI::App& program, const std::vector<std::string>& arguments);

// Returns the message for `error`, which `program` has thrown while it parsed `arguments`. Prefers mistyped arguments
// over missing ones as the cause. Never quotes the value of an option, because it may be a secret.
std::string ExplainUsage(const CLI::App& program, const CLI::ParseError& error,
                         const std::vector<std::string>& arguments);

// Returns what is wrong with an option that is given an empty text, which commands take for an option that is not
// given; empty: nothing. Options of the configuration decide themselves, because some may be empty.
std::string ExplainEmptyText(const std::vector<std::string>& arguments);

}  // namespace terrace::cli

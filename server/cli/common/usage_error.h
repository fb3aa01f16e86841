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

// Returns what is wrong with an option whose value is an empty text or another option, as if a script's variable is not
// set; empty: nothing. The parser takes both as values. Empty texts of options of the configuration are left to them.
std::string ExplainMissingValue(const CLI::App& program, const std::vector<std::string>& arguments);

}  // namespace terrace::cli

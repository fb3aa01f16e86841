// What is wrong with the arguments of the command line, and what was meant.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace terrace::cli {

// Whether it stands where a command should. Help is given all the same to who asks for it.
bool HasUnknownCommand(const CLI::App& program, const std::vector<std::string>& arguments);

// `program`: with all its commands, after it has thrown `error` while it parsed `arguments`. Says what was mistyped
// rather than what is missing, and never the value of an option: a secret may stand there by mistake.
std::string ExplainUsage(const CLI::App& program, const CLI::ParseError& error,
                         const std::vector<std::string>& arguments);

}  // namespace terrace::cli

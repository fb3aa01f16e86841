// One subcommand of `terrace`: adds its flags to the parser, and runs.
#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"

namespace CLI {
class App;
}

namespace terrace::cli {

// Exit codes of the process.
inline constexpr int kExitOk = 0;
inline constexpr int kExitFailure = 1;  // the work could not be done
inline constexpr int kExitUsage = 2;    // the command line or the configuration is wrong

inline constexpr const char* kCommands = "Commands";  // heading in the help

// Prints "terrace: MESSAGE" on stderr; returns the exit code.
inline int Fail(const std::string& message, int code) {
  std::fprintf(stderr, "terrace: %s\n", message.c_str());
  return code;
}

// The same; the code says whether the user can correct the command.
inline int Fail(const Error& error) {
  return Fail(error.message, error.code == ErrorCode::kInvalidArgument ? kExitUsage : kExitFailure);
}

// The same for each error of the command or the configuration.
inline int Fail(const std::vector<config::ConfigError>& errors) {
  for (const config::ConfigError& error : errors) Fail(error.Text(), kExitUsage);
  return kExitUsage;
}

// Flushes stdout. Returns `code`, or kExitFailure if stdout could not be written.
inline int FinishOutput(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::perror("terrace: stdout cannot be written");
  return code == kExitOk ? kExitFailure : code;
}

// Each adds its subcommand to `app`. If the user selects it, the parser's callback runs it and stores the exit code in
// `exit_code`.
void AddServe(CLI::App& app, int& exit_code);
void AddMesh(CLI::App& app, int& exit_code);
void AddInfo(CLI::App& app, int& exit_code);
void AddBake(CLI::App& app, int& exit_code);
void AddFly(CLI::App& app, int& exit_code);

}  // namespace terrace::cli

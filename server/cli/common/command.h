// One subcommand of `terrace`: adds its flags to the parser, and runs.
#pragma once

namespace CLI {
class App;
}

namespace terrace::cli {

// Exit codes of the process.
inline constexpr int kExitOk = 0;
inline constexpr int kExitFailure = 1;  // the work could not be done
inline constexpr int kExitUsage = 2;    // the command line or the configuration is wrong

inline constexpr const char* kCommands = "Commands";  // heading in the help

// Each adds its subcommand to `app`. If the user selects it, the parser's callback runs it and stores the exit code in
// `exit_code`.
void AddServe(CLI::App& app, int& exit_code);
void AddMesh(CLI::App& app, int& exit_code);
void AddInfo(CLI::App& app, int& exit_code);

}  // namespace terrace::cli

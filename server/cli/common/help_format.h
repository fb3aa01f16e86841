// The format of `--help`: descriptions in their own column, wrapped to the width of a terminal.
#pragma once

namespace CLI {
class App;
}

namespace terrace::cli {

// Sets the format for the program and for commands that are added later.
void SetHelpFormat(CLI::App& program);

}  // namespace terrace::cli

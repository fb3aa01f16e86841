// The format of `--help`: descriptions in their own column, wrapped to the width of a terminal.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace terrace::cli {

// Sets the format for the program and for commands that are added later.
void SetHelpFormat(CLI::App& program);

// Wraps `text` at blanks into lines of at most `width` characters. Longer words stay whole.
std::string WrapLines(const std::string& text, std::size_t width);

}  // namespace terrace::cli

// How `--help` looks: descriptions in a column of their own, broken into lines that fit a terminal.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace terrace::cli {

// For the program and the commands that are added to it from then on.
void SetHelpFormat(CLI::App& program);

// `text` in lines of `width` at most, broken at blanks. Longer words stay whole.
std::string WrapLines(const std::string& text, std::size_t width);

}  // namespace terrace::cli

#include "server/cli/common/help_format.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <set>
#include <string>

namespace terrace::cli {
namespace {

// Wraps `text` at blanks into lines of at most `width` characters. Longer words stay whole.
std::string WrapLines(const std::string& text, std::size_t width) {
  std::string wrapped;
  std::size_t line = 0;  // its length so far
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find(' ', at), text.size());
    const bool fits = line == 0 || line + 1 + end - at <= width;
    if (!wrapped.empty()) wrapped += fits ? ' ' : '\n';
    line = fits && line > 0 ? line + 1 + end - at : end - at;
    wrapped += text.substr(at, end - at);
    at = end + 1;
  }
  return wrapped;
}

constexpr std::size_t kLine = 100, kColumn = 30;

std::string Others(const char* how, const std::set<CLI::Option*>& others) {
  std::string names;
  for (const CLI::Option* other : others) names += (names.empty() ? "" : ", ") + other->get_name();
  return names.empty() ? "" : std::string("; ") + how + ' ' + names;
}

class HelpFormat final : public CLI::Formatter {
 public:
  HelpFormat() {
    column_width(kColumn);
    label("Positionals", "Arguments");
    label("SUBCOMMAND", "COMMAND");
  }

  std::string make_option_opts(const CLI::Option* option) const override {
    const bool has_value = !option->get_positional() && option->get_type_size() != 0;
    // The blank at the end keeps two between a name and its description; without them help2man sees one text.
    return (has_value && !option->get_type_name().empty() ? ' ' + option->get_type_name() : "") + ' ';
  }

  std::string make_option_desc(const CLI::Option* option) const override {
    std::string text = option->get_description();
    text += Others("needs", option->get_needs()) + Others("not with", option->get_excludes());
    if (option->get_required()) text += " (required)";
    if (!option->get_default_str().empty()) text += " [" + option->get_default_str() + ']';
    return WrapLines(text, kLine - kColumn);
  }
};

}  // namespace

void SetHelpFormat(CLI::App& program) { program.formatter(std::make_shared<HelpFormat>()); }

}  // namespace terrace::cli

// Text in HTML.
#pragma once

#include <string>
#include <string_view>

namespace terrace {

// Writes &, < and > as entities, and " too unless `quotes` is false; values of attributes need that.
std::string EscapeHtml(std::string_view text, bool quotes = true);

}  // namespace terrace

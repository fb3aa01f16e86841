// Text in HTML.
#pragma once

#include <string>
#include <string_view>

namespace terrace {

// Writes &, <, > and " as entities, for text and for values of attributes in double quotes.
std::string EscapeHtml(std::string_view text);

}  // namespace terrace

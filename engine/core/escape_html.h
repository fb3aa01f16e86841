// Text in HTML.
#pragma once

#include <string>
#include <string_view>

namespace terrace {

// Writes &, < and > as entities and, unless `quotes` is false, " too, which must be an entity in attribute values.
std::string EscapeHtml(std::string_view text, bool quotes = true);

}  // namespace terrace

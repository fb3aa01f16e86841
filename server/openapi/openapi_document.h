// Writes the OpenAPI 3.1 document of a table of URLs. Pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/openapi/operation.h"

namespace terrace::server {

// A URL to describe.
struct DocumentedUrl {
  std::string pattern;                   // "/{dataset}/{z}/{x}/{y}.terrain"
  const Operation* operation = nullptr;  // null: only its pattern is known
  bool takes_post = false;
  bool takes_any_query = false;
  bool needs_grant = false;  // the reply depends on a token, where the server has tokens
};

// The document as JSON; equal for equal URLs.
std::string WriteOpenApi(const std::vector<DocumentedUrl>& urls);

// The variables (RFC 6570) of a pattern in their order: "dataset", "z", "x", "y".
std::vector<std::string_view> VariablesOf(std::string_view pattern);

// The value that a target has for a variable of the pattern; nothing if they do not match. The query does not count.
std::optional<std::string> ValueIn(std::string_view target, std::string_view pattern, std::string_view variable);

}  // namespace terrace::server

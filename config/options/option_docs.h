// Generates documents from the option tables: the JSON schema of the configuration file, and the tables of
// docs/configuration.md. `make docs` writes both.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::config {

// config/config.schema.json (JSON Schema 2020-12), with a final newline.
std::string SchemaText();

// Returns `manual` with current tables of options. Each table is between two lines:
//   <!-- options: NAME -->
//   <!-- end of options -->
// kInvalidArgument: a marker has no end, names no table or occurs twice, or a table has no marker.
Result<std::string> UpdateManual(std::string_view manual);

}  // namespace terrace::config

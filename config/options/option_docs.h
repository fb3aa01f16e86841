// What the option tables say to editors and readers: the JSON schema of the file, and the tables of
// docs/configuration.md. `make docs` writes both.
#pragma once

#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::config {

// config/config.schema.json (JSON Schema 2020-12), with a final newline.
std::string SchemaText();

// `manual` with its tables of options as the tables are now. A table stands between two lines:
//   <!-- options: NAME -->
//   <!-- end of options -->
// kInvalidArgument: a marker without its end, of no table, or twice, or a table without a marker.
Result<std::string> UpdateManual(std::string_view manual);

}  // namespace terrace::config

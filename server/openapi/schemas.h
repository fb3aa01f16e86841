// Schemas and tables that the operations of /openapi.json refer to by name. Plain constants.
#pragma once

#include <span>
#include <string_view>

namespace terrace::server {

// JSON Schema 2020-12 of a JSON reply, as JSON.
struct NamedSchema {
  std::string_view name, schema;
};
std::span<const NamedSchema> Schemas();

// A variable of a URL's pattern.
struct PathNote {
  std::string_view name, meaning, schema;
};
std::span<const PathNote> PathNotes();

struct HeaderNote {
  std::string_view name, meaning, schema;
};
std::span<const HeaderNote> HeaderNotes();

struct TagNote {
  std::string_view name, meaning;
};
std::span<const TagNote> TagNotes();

}  // namespace terrace::server

// The tables that declare every option once: key, flag, type, range, help and reference. The default is the member's in
// config.h. The parser, the writer, the command line, the schema and the reference in docs/configuration.md are
// generated from them; a new option is one row (CONTRIBUTING.md). For this module only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/common/nearest_name.h"
#include "config/config.h"
#include "config/options/option_codec.h"

namespace terrace::config {

// The key that names the schema for editors; it is not an option.
inline constexpr const char* kSchemaKey = "$schema";

template <typename Target>
struct Option {
  std::string_view key;
  std::string_view value = {};    // placeholder for the value in --help: "BYTES"
  std::string_view section = {};  // of docs/configuration.md; only for options at the top level of the file
  std::string_view help;          // one line without a full stop, for --help, the schema and the reference
  std::string_view details = {};  // Markdown that the reference appends to it, without a full stop
  Codec<Target> codec;
  std::string_view other_words = {};  // names that other programs use, for "did you mean": "port host"
  std::string_view missing = {};      // for required keys: the text after `"key" is missing` in the error
  bool is_live = false;               // a change needs no restart; only for options at the top level of the file
};

template <typename Target>
std::vector<KnownName> KnownNames(const std::vector<Option<Target>>& table) {
  std::vector<KnownName> names;
  for (const Option<Target>& option : table) names.push_back({option.key, option.other_words});
  return names;
}

const std::vector<Option<Config>>& ServerOptionTable();
const std::vector<Option<DatasetConfig>>& DatasetOptionTable();

// The default as JSON; empty: none.
template <typename Target>
std::string DefaultOf(const Option<Target>& option) {
  const std::string value = option.codec.write(Target{}).dump();
  return value == "null" || value == "\"\"" || value == "[]" ? "" : value;
}

// Reads every key of `object` by the table. Missing required keys and unknown keys are errors. Unknown keys are
// reported by their position, and by name only if they resemble a known key of this or another object.
template <typename Target>
void ReadObject(const Json& object, const Place& place, const std::vector<Option<Target>>& table, Target& target);

// Writes every option that has a value, in the order of the table.
template <typename Target>
Json WriteObject(const Target& source, const std::vector<Option<Target>>& table);

// Returns the JSON Schema of the object.
template <typename Target>
Json ObjectSchema(const std::vector<Option<Target>>& table);

}  // namespace terrace::config

// The tables that declare every option once: key, flag, type, range, help and reference. The default is the member's in
// config.h. The parser, the writer, the command line, the schema and the reference in docs/configuration.md are made
// of them; an option is added by one row (CONTRIBUTING.md). Used inside this room only.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/common/nearest_name.h"
#include "config/config.h"
#include "config/options/option_codec.h"

namespace terrace::config {

// Editors find the schema through this key at the top of the file; it is no option.
inline constexpr const char* kSchemaKey = "$schema";

template <typename Target>
struct Option {
  std::string_view key;
  std::string_view value = {};    // what stands for the value in --help: "BYTES"
  std::string_view section = {};  // of docs/configuration.md; of options at the top of the file alone
  std::string_view help;          // one line without a final stop: --help, the schema, and the reference begin with it
  std::string_view details = {};  // Markdown that the reference adds to it, without a final stop
  Codec<Target> codec;
  std::string_view other_words = {};  // what others call it, for "did you mean": "port host"
  std::string_view missing = {};      // of a key that every object needs: what follows `"key" is missing` in the error
  bool is_live = false;               // a change takes no restart; of options at the top of the file alone
};

template <typename Target>
std::vector<KnownName> KnownNames(const std::vector<Option<Target>>& table) {
  std::vector<KnownName> names;
  for (const Option<Target>& option : table) names.push_back({option.key, option.other_words});
  return names;
}

const std::vector<Option<Config>>& ServerOptionTable();
const std::vector<Option<DatasetConfig>>& DatasetOptionTable();

// As JSON; empty: there is none.
template <typename Target>
std::string DefaultOf(const Option<Target>& option) {
  const std::string value = option.codec.write(Target{}).dump();
  return value == "null" || value == "\"\"" || value == "[]" ? "" : value;
}

// Reads every key of `object` by the table. Missing keys that every object needs are errors, and so are unknown ones:
// these are told by their number, and by their name where that resembles a known one, of this object or of another.
template <typename Target>
void ReadObject(const Json& object, const Place& place, const std::vector<Option<Target>>& table, Target& target);

// Every option of the table that has a value, in the order of the table.
template <typename Target>
Json WriteObject(const Target& source, const std::vector<Option<Target>>& table);

// JSON Schema of such an object.
template <typename Target>
Json ObjectSchema(const std::vector<Option<Target>>& table);

}  // namespace terrace::config

// The two tables that decide everything about options: their keys, flags, limits and help. The parser, the writer, the
// command line, and the tests of the schema and the documentation all read them. Used inside this room only.
#pragma once

#include <string_view>
#include <vector>

#include "config/config.h"
#include "config/option_codec.h"

namespace terrace::config {

template <typename Target>
struct Option {
  std::string_view key;
  std::string_view value;
  std::string_view help;
  Codec<Target> codec;
};

const std::vector<Option<Config>>& ServerOptionTable();
const std::vector<Option<DatasetConfig>>& DatasetOptionTable();

// Reads every key of `object` by the table; unknown keys are errors, told by their number, and by their name where that
// resembles a known one.
template <typename Target>
void ReadObject(const Json& object, const Place& place, const std::vector<Option<Target>>& table, Target& target);

// Every option of the table that has a value, in the order of the table.
template <typename Target>
Json WriteObject(const Target& source, const std::vector<Option<Target>>& table);

}  // namespace terrace::config

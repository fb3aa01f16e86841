// The tables that declare every option once: key, flag, type, range, help and reference. The default is the member's in
// config.h. The parser, the writer, the command line, the schema and the reference in docs/configuration.md are
// generated from them; a new option is one row (CONTRIBUTING.md). For the modules of config/ only.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/config.h"
#include "config/options/option_codec.h"
#include "engine/core/nearest_name.h"

namespace terrace::config {

// The key that names the schema for editors; it is not an option.
inline constexpr const char* kSchemaKey = "$schema";

template <typename Target>
struct Option {
  std::string_view key;
  std::string_view value = {};    // word for the value in --help: "BYTES"
  std::string_view section = {};  // of docs/configuration.md; only for options at the top level of the file
  std::string_view help;          // one line without a full stop, for --help, the schema and the reference
  std::string_view details = {};  // Markdown that the reference appends to it, without a full stop
  Codec<Target> codec;
  std::string_view other_words = {};  // names that other programs use, for "did you mean": "port host"
  std::string_view missing = {};      // for required keys: the text after `"key" is missing` in the error
  std::string_view unless = {};       // the key is required unless this other key is present
  bool is_live = false;               // a change needs no restart; only for options at the top level of the file
  // What the option depends on, after "needs" in the reference and in a warning. Without it, a value other than the
  // default has no effect.
  std::string_view needs = {};
  bool (*is_used)(const Target&) = nullptr;  // whether what it needs is there; null: it needs nothing
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

// unknown_key.cc
// Returns a sentence for the error at the key. `known`: the keys of its object. If another kind of object has the key,
// the sentence says where it belongs; else it names similar keys. Empty: the key resembles no known one, and no message
// may quote it.
std::string ExplainKey(std::string_view key, std::span<const KnownName> known);

// Reads every key of `object` by the table. Missing required keys and unknown keys are errors. Unknown keys are
// reported by their position, and by name only if they resemble a known key of this or another object.
template <typename Target>
void ReadObject(const Json& object, const ConfigLocation& place, const std::vector<Option<Target>>& table,
                Target& target) {
  if (!object.is_object())
    return place.Expected("an object with keys such as \"" + std::string(table.front().key) + "\"");
  std::vector<std::string_view> keys;
  keys.reserve(table.size());
  for (const Option<Target>& option : table) keys.push_back(option.key);
  std::size_t number = 0;
  for (const auto& [key, value] : object.items()) {
    ++number;
    const auto found = std::find(keys.begin(), keys.end(), key);
    if (found != keys.end()) {
      table[static_cast<std::size_t>(found - keys.begin())].codec.read(value, place.At(key), target);
      continue;
    }
    if (const std::string problem = ExplainKey(key, KnownNames(table)); problem.empty()) {
      place.Fail(fmt::format("key {} of this object is unknown; known are {}", number, fmt::join(keys, ", ")));
    } else {
      place.At(key).Fail(problem);
    }
  }
  for (const Option<Target>& option : table) {
    if (option.missing.empty() || object.contains(option.key)) continue;
    if (!option.unless.empty() && object.contains(option.unless)) continue;
    place.Fail(fmt::format("\"{}\" is missing{}", option.key, option.missing));
  }
}

// Writes every option that has a value, in the order of the table.
template <typename Target>
Json WriteObject(const Target& source, const std::vector<Option<Target>>& table) {
  Json object = Json::object();
  for (const Option<Target>& option : table) {
    Json value = option.codec.write(source);
    if (!value.is_null()) object[std::string(option.key)] = std::move(value);
  }
  return object;
}

// Returns the JSON Schema of the object.
template <typename Target>
Json ObjectSchema(const std::vector<Option<Target>>& table) {
  Json required = Json::array(), any = Json::array(), properties = Json::object();
  for (const Option<Target>& option : table) {
    if (!option.missing.empty() && option.unless.empty()) required.push_back(option.key);
    if (!option.unless.empty()) {
      for (const std::string_view key : {option.key, option.unless}) any.push_back({{"required", Json::array({key})}});
    }
    Json& property = properties[std::string(option.key)] = {{"description", option.help}};
    property.update(option.codec.schema);
    if (const std::string value = DefaultOf(option); !value.empty()) property["default"] = Json::parse(value);
  }
  Json schema = {{"type", "object"}, {"additionalProperties", false}};
  if (!required.empty()) schema["required"] = std::move(required);
  if (!any.empty()) schema["anyOf"] = std::move(any);
  schema["properties"] = std::move(properties);
  return schema;
}

// An object with the options of `table`, which outlives the codec; its flag sets only the first option,
// the object's member `first`. While `first` is empty, the object counts as not set. `example`: for the error that the
// value is no object.
template <typename Target, typename Object>
Codec<Target> ObjectOf(Object Target::*member, std::string Object::*first, const std::vector<Option<Object>>& table,
                       const char* example) {
  return {[=, &table](const Json& value, const ConfigLocation& place, Target& target) {
            if (!value.is_object()) return place.Expected(example);
            ReadObject(value, place, table, target.*member);
          },
          [=, &table](const Target& target) {
            return (target.*member.*first).empty() ? Json() : WriteObject(target.*member, table);
          },
          [&table](const std::string& text) {
            return Json{{std::string(table.front().key), text}};
          },
          ObjectSchema(table)};
}

// dataset_name.cc
// First path segments of the server's own URLs.
std::span<const std::string_view> ReservedDatasetNames();

// source_options.cc
// ["dem.tif", {"path": "other.tif", "vertical": "egm96"}]
Codec<DatasetConfig> SourcesCodec();

// The options of an entry that is an object.
const std::vector<Option<SourceConfig>>& SourceOptionTable();

// "crs", "unknown", "ellipsoid", "egm96", "egm2008", "EPSG:5703", or the path of a grid.
Codec<DatasetConfig> VerticalCodec();

// "auto", "declared", a number or a list of numbers.
Codec<DatasetConfig> NodataCodec();

// water_imagery_options.cc
// {"mask": "water.tif"} or {"sea_level": 0}. As a flag: a number is a sea level, any other text the path of a mask.
Codec<DatasetConfig> WaterCodec();

// {"image": "photo.tif", "attribution": ..., ...}. As a flag: only the path.
Codec<DatasetConfig> ImageryCodec();

const std::vector<Option<ImageryConfig>>& ImageryOptionTable();

// disk_cache_option.cc
// {"directory": "/var/cache/terrace/tiles", "tile_bytes": ..., ...}. As a flag: only the directory.
Codec<Config> DiskCacheCodec();

const std::vector<Option<DiskCacheConfig>>& DiskCacheOptionTable();

// shared_cache_option.cc
// {"url": "redis://cache:6379/0", "timeout_ms": 25, ...}. As a flag: only the URL.
Codec<Config> SharedCacheCodec();

const std::vector<Option<SharedCacheConfig>>& SharedCacheOptionTable();

// client_options.cc
// [{"name": "field-team", "sha256": "9f86d0...", "datasets": ["maui"]}]. No flag, because command lines are not secret.
Codec<Config> TokensCodec();

const std::vector<Option<TokenConfig>>& TokenOptionTable();

// {"certificate": "server.pem", "key": "server.key"}. As a flag: the two paths, separated by a comma.
Codec<Config> TlsCodec();

// ["https://maps.example"], ["*"] or []. As a flag: with commas between them.
Codec<Config> OriginsCodec();

// ["10.0.0.0/8", "::1"]. As a flag: with commas between them.
Codec<Config> ProxiesCodec();

}  // namespace terrace::config

#include "config/options/option_table.h"

#include <algorithm>

namespace terrace::config {

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

template <typename Target>
Json WriteObject(const Target& source, const std::vector<Option<Target>>& table) {
  Json object = Json::object();
  for (const Option<Target>& option : table) {
    Json value = option.codec.write(source);
    if (!value.is_null()) object[std::string(option.key)] = std::move(value);
  }
  return object;
}

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

template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<Config>>&, Config&);
template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<DatasetConfig>>&, DatasetConfig&);
template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<ImageryConfig>>&, ImageryConfig&);
template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<DiskCacheConfig>>&,
                         DiskCacheConfig&);
template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<SharedCacheConfig>>&,
                         SharedCacheConfig&);
template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<SourceConfig>>&, SourceConfig&);
template void ReadObject(const Json&, const ConfigLocation&, const std::vector<Option<TokenConfig>>&, TokenConfig&);
template Json WriteObject(const Config&, const std::vector<Option<Config>>&);
template Json WriteObject(const DatasetConfig&, const std::vector<Option<DatasetConfig>>&);
template Json WriteObject(const ImageryConfig&, const std::vector<Option<ImageryConfig>>&);
template Json WriteObject(const SourceConfig&, const std::vector<Option<SourceConfig>>&);
template Json WriteObject(const TokenConfig&, const std::vector<Option<TokenConfig>>&);
template Json WriteObject(const DiskCacheConfig&, const std::vector<Option<DiskCacheConfig>>&);
template Json WriteObject(const SharedCacheConfig&, const std::vector<Option<SharedCacheConfig>>&);
template Json ObjectSchema(const std::vector<Option<Config>>&);
template Json ObjectSchema(const std::vector<Option<DatasetConfig>>&);
template Json ObjectSchema(const std::vector<Option<ImageryConfig>>&);
template Json ObjectSchema(const std::vector<Option<SourceConfig>>&);
template Json ObjectSchema(const std::vector<Option<TokenConfig>>&);
template Json ObjectSchema(const std::vector<Option<DiskCacheConfig>>&);
template Json ObjectSchema(const std::vector<Option<SharedCacheConfig>>&);

}  // namespace terrace::config

#include "config/options/option_docs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

#include "config/options/option_table.h"
#include "config/options/options.h"
#include "engine/core/nearest_name.h"

namespace terrace::config {
namespace {

constexpr std::string_view kBegin = "<!-- options: ", kBeginEnd = " -->\n", kEnd = "<!-- end of options -->\n";
constexpr std::int64_t kTebibyte = std::int64_t{1} << 40;

// "1,000,000", "0.05", "1 TiB"
std::string NumberText(const Json& number) {
  if (!number.is_number_integer()) return number.dump();
  const auto value = number.get<std::int64_t>();
  if (value == kTebibyte) return "1 TiB";
  std::string digits = number.dump();
  for (auto end = static_cast<std::ptrdiff_t>(digits.size()) - 3; end > (value < 0 ? 1 : 0); end -= 3) {
    digits.insert(static_cast<std::size_t>(end), ",");
  }
  return digits;
}

// The values that a schema allows, each for people: "1 to 64"; "`smooth`", "`floor`"; "`true`", "`false`", "text".
std::vector<std::string> ValuesOf(const Json& schema) {
  std::vector<std::string> values;
  if (schema.contains("enum")) {
    for (const Json& word : schema["enum"]) {
      values.push_back(fmt::format("`{}`", word.is_string() ? word.get<std::string>() : word.dump()));
    }
    return values;
  }
  if (schema.contains("anyOf")) {
    for (const Json& kind : schema["anyOf"]) {
      for (std::string& value : ValuesOf(kind)) {
        if (std::find(values.begin(), values.end(), value) == values.end()) values.push_back(std::move(value));
      }
    }
    return values;
  }
  if (schema.contains("minimum")) return {NumberText(schema["minimum"]) + " to " + NumberText(schema["maximum"])};
  const auto type = schema.at("type").get<std::string>();
  if (type == "boolean") return {"`true`", "`false`"};
  if (type == "string") return {"text"};
  return {type == "array" ? "list" : type};
}

// The word for the value in the help states its unit.
std::string UnitOf(std::string_view value) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 2> kUnits = {
      {{"METRES", " metres"}, {"SECONDS", " seconds"}}};
  const auto found = std::find_if(kUnits.begin(), kUnits.end(), [&](const auto& unit) { return unit.first == value; });
  return found == kUnits.end() ? "" : std::string(found->second);
}

template <typename Target>
std::string MeaningOf(const Option<Target>& option, bool has_flag) {
  const char* required = has_flag ? "Required in the file. " : "Required. ";
  std::string meaning = option.missing.empty() ? "" : required;
  if (!option.unless.empty()) meaning = fmt::format("Required without `{}`. ", option.unless);
  meaning += option.help;
  if (!option.details.empty()) meaning += fmt::format(". {}", option.details);
  if (!option.needs.empty()) meaning += fmt::format(". Needs {}", option.needs);
  if (option.is_live) meaning += ". A change needs no restart";
  // A vertical bar ends a cell.
  for (std::size_t at = 0; (at = meaning.find('|', at)) != std::string::npos; at += 2) meaning.insert(at, "\\");
  return meaning;
}

template <typename Target>
std::string RowOf(const Option<Target>& option, bool has_flags) {
  const std::string default_value = DefaultOf(option);
  std::string row = fmt::format("| `{}` | ", option.key);
  if (has_flags) row += option.codec.from_text == nullptr ? "none | " : fmt::format("`{}` | ", FlagOf(option.key));
  row += default_value.empty() ? "none" : '`' + default_value + '`';
  row += fmt::format(" | {}{} | {} |\n", Alternatives(ValuesOf(option.codec.schema)), UnitOf(option.value),
                     MeaningOf(option, has_flags && option.codec.from_text != nullptr));
  return row;
}

std::string HeadOf(const std::string& keys, bool has_flags) {
  return has_flags ? "| key | flag | default | values | meaning |\n| --- | --- | --- | --- | --- |\n"
                   : fmt::format("| {} | default | values | meaning |\n| --- | --- | --- | --- |\n", keys);
}

template <typename Target>
std::string TableOf(const std::vector<Option<Target>>& options, const std::string& keys, bool has_flags) {
  std::string table = HeadOf(keys, has_flags);
  for (const Option<Target>& option : options) table += RowOf(option, has_flags);
  return table;
}

// Tables by name. Tables of top-level options are named after their sections.
std::map<std::string, std::string, std::less<>> Tables() {
  std::map<std::string, std::string, std::less<>> tables;
  for (const Option<Config>& option : ServerOptionTable()) {
    std::string& table = tables[std::string(option.section)];
    if (table.empty()) table = HeadOf("", /*has_flags=*/true);
    table += RowOf(option, /*has_flags=*/true);
  }
  tables["dataset"] = TableOf(DatasetOptionTable(), "", /*has_flags=*/true);
  tables["disk_cache"] = TableOf(DiskCacheOptionTable(), "key of `disk_cache`", /*has_flags=*/false);
  tables["shared_cache"] = TableOf(SharedCacheOptionTable(), "key of `shared_cache`", /*has_flags=*/false);
  tables["imagery"] = TableOf(ImageryOptionTable(), "key of `imagery`", /*has_flags=*/false);
  tables["source"] = TableOf(SourceOptionTable(), "key of a source", /*has_flags=*/false);
  tables["token"] = TableOf(TokenOptionTable(), "key of a token", /*has_flags=*/false);
  return tables;
}

}  // namespace

std::string SchemaText() {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                 {"title", "terrace configuration"},
                 {"description",
                  "What `terrace serve --config` reads. Every key is optional; docs/configuration.md explains them. "
                  "Relative paths are relative to the folder of the file."}};
  Json object = ObjectSchema(ServerOptionTable());
  object["properties"][kSchemaKey] = {{"description", "Where editors find this schema; the server does not read it."},
                                      {"type", "string"}};
  schema.update(object);
  return schema.dump(2) + '\n';
}

Result<std::string> UpdateManual(std::string_view manual) {
  auto tables = Tables();
  std::string text;
  for (std::size_t at = 0;;) {
    const std::size_t begin = std::min(manual.find(kBegin, at), manual.size());
    text += manual.substr(at, begin - at);
    if (begin == manual.size()) break;
    const std::size_t name_at = begin + kBegin.size(), name_end = manual.find(kBeginEnd, name_at);
    const std::size_t end = manual.find(kEnd, name_at);
    const std::string_view name = manual.substr(name_at, name_end - name_at);
    const auto table = tables.find(name);
    if (name_end == std::string_view::npos || end == std::string_view::npos || table == tables.end()) {
      return MakeError(ErrorCode::kInvalidArgument, "options: {}: no such table, two of it, or no end of it",
                       name.substr(0, name.find('\n')));
    }
    text += fmt::format("{}{}{}{}{}", kBegin, name, kBeginEnd, table->second, kEnd);
    tables.erase(table);
    at = end + kEnd.size();
  }
  if (!tables.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "options: {}: no marker of this table", tables.begin()->first);
  }
  return text;
}

}  // namespace terrace::config

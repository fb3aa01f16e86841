// Reads the values of options from JSON and writes them back. For this module only.
// A codec belongs to one member of Config, DatasetConfig or a struct in them. `read` sets the member, or reports what
// the value must be. `write` returns a value that `read` accepts. `from_text` converts the text of a flag to such a
// value. `schema` is the JSON Schema of the values that `read` accepts.
#pragma once

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/input/config_location.h"
#include "config/input/json_text.h"
#include "engine/core/ascii.h"
#include "engine/core/names.h"

namespace terrace::config {

template <typename Target>
struct Codec {
  std::function<void(const Json&, const ConfigLocation&, Target&)> read;
  std::function<Json(const Target&)> write;
  std::function<Json(const std::string&)> from_text = nullptr;  // null: the option has no flag
  Json schema = {};
};

inline Json TextToJson(const std::string& text) { return text; }

// Converts "12" and "1e3" to numbers; other text stays text, which the codec accepts or refuses.
Json NumberToJson(const std::string& text);
// Converts "true" and "false" to booleans; other text stays text.
Json SwitchToJson(const std::string& text);

// Converts texts separated by commas to a list; an empty text is one empty part.
Json TextsToJson(const std::string& text);

// Schemas.
inline constexpr const char* kNonEmptyText = R"({"type": "string", "minLength": 1})";
inline constexpr const char* kOneLinePattern = R"(^[^\u0000-\u001f\u007f]*$)";
inline constexpr const char* kBytesPattern = R"(^(0|[1-9][0-9]*)(\.[0-9]+)? *(B|kB|KB|MB|GB|TB|KiB|MiB|GiB|TiB)?$)";
inline constexpr const char* kNamePattern = "^[A-Za-z0-9._-]{1,64}$";
inline Json TextLike(const char* pattern) { return {{"type", "string"}, {"pattern", pattern}}; }
inline Json ListOf(Json items) { return {{"type", "array"}, {"items", std::move(items)}}; }
inline Json InRange(const char* type, Json min, Json max) {
  return {{"type", type}, {"minimum", std::move(min)}, {"maximum", std::move(max)}};
}

inline constexpr double kMaxHeight = 20'000;  // metres, up and down

// A check for Text: returns "must be text on one line", or an empty string.
std::string CheckOneLine(const std::string& text);

// A whole number from -2^53 to 2^53, which a double represents exactly. 1e3 and 1000.0 are whole.
std::optional<std::int64_t> WholeNumber(const Json& value);
// 268435456, "512MB", "1GiB", "64 MiB"
std::optional<std::int64_t> ByteCount(const Json& value);
// Writes whole values without a fraction: 30, not 30.0.
Json NumberOut(double value);

template <typename Target, typename Member>
Codec<Target> Integer(Member Target::*member, std::int64_t min, std::int64_t max) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            const std::optional<std::int64_t> number = WholeNumber(value);
            if (!number || *number < min || *number > max) {
              return place.Expected(fmt::format("a whole number from {} to {}", min, max));
            }
            target.*member = static_cast<Member>(*number);
          },
          [=](const Target& target) { return Json(target.*member); }, NumberToJson, InRange("integer", min, max)};
}

template <typename Target>
Codec<Target> Bytes(std::size_t Target::*member, std::int64_t max) {
  return {
      [=](const Json& value, const ConfigLocation& place, Target& target) {
        const std::optional<std::int64_t> number = ByteCount(value);
        if (!number || *number < 0 || *number > max) {
          return place.Expected(fmt::format("a number of bytes up to {}, or text such as \"512MB\" or \"1GiB\"", max));
        }
        target.*member = static_cast<std::size_t>(*number);
      },
      [=](const Target& target) { return Json(target.*member); }, NumberToJson,
      Json{{"anyOf", Json::array({InRange("integer", 0, max), TextLike(kBytesPattern)})},
           {"examples", Json::array({"512MB", "1GiB"})}}};
}

// Both ends belong to the range.
template <typename Target, typename Member>
Codec<Target> Number(Member Target::*member, double min, double max) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            const double number = value.is_number() ? value.get<double>() : std::nan("");
            if (!(number >= min && number <= max)) {
              return place.Expected(fmt::format("a number from {} to {}", min, max));
            }
            target.*member = number;
          },
          [=](const Target& target) {
            const std::optional<double> number = target.*member;
            return number ? NumberOut(*number) : Json();
          },
          NumberToJson, InRange("number", NumberOut(min), NumberOut(max))};
}

template <typename Target>
Codec<Target> Switch(bool Target::*member) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            if (!value.is_boolean()) return place.Expected("true or false");
            target.*member = value.get<bool>();
          },
          [=](const Target& target) { return Json(target.*member); }, SwitchToJson, Json{{"type", "boolean"}}};
}

template <typename Target>
Codec<Target> Seconds(std::chrono::milliseconds Target::*member, double min, double max) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            const double seconds = value.is_number() ? value.get<double>() : std::nan("");
            if (!(seconds >= min && seconds <= max)) {
              return place.Expected(fmt::format("a number of seconds from {} to {}", min, max));
            }
            target.*member = std::chrono::milliseconds(std::llround(seconds * 1000));
          },
          [=](const Target& target) { return NumberOut(static_cast<double>((target.*member).count()) / 1000); },
          NumberToJson, InRange("number", NumberOut(min), NumberOut(max))};
}

// One of a few words or numbers.
template <typename Target, typename Member>
Codec<Target> Choice(Member Target::*member, std::vector<std::pair<Json, Member>> words) {
  Json schema = {{"enum", Json::array()}};
  for (const auto& [word, meaning] : words) schema["enum"].push_back(word);
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            std::string allowed;
            for (const auto& [word, meaning] : words) {
              if (value == word) {
                target.*member = meaning;
                return;
              }
              allowed += (allowed.empty() ? "" : " or ") + word.dump();
            }
            place.Expected(allowed);
          },
          [=](const Target& target) {
            for (const auto& [word, meaning] : words) {
              if (meaning == target.*member) return word;
            }
            return Json();
          },
          TextToJson, std::move(schema)};
}

template <typename Target, typename Member, std::size_t kCount>
Codec<Target> Choice(Member Target::*member, const Names<Member, kCount>& names) {
  return Choice(member, std::vector<std::pair<Json, Member>>(names.begin(), names.end()));
}

// Text that passes `check`, which returns "must be ..." or an empty string.
template <typename Target>
Codec<Target> Text(std::string Target::*member, const std::function<std::string(const std::string&)>& check,
                   Json schema) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            if (!value.is_string()) return place.Expected("text");
            const std::string problem = check(value.get_ref<const std::string&>());
            if (!problem.empty()) return place.Fail(problem);
            target.*member = value.get<std::string>();
          },
          [=](const Target& target) { return Json(target.*member); }, TextToJson, std::move(schema)};
}

// `what`: "the path of a directory". A relative path begins at the file's folder.
template <typename Target>
Codec<Target> Path(std::string Target::*member, const char* what) {
  return {[=](const Json& value, const ConfigLocation& place, Target& target) {
            if (!value.is_string() || value.get_ref<const std::string&>().empty()) return place.Expected(what);
            target.*member = place.Resolve(value.get<std::string>());
          },
          [=](const Target& target) { return (target.*member).empty() ? Json() : Json(target.*member); }, TextToJson,
          Json::parse(kNonEmptyText)};
}

// A list of texts. `is_path`: the texts are paths, relative to the folder of the file. As a flag: texts separated by
// commas.
template <typename Target>
Codec<Target> TextList(std::vector<std::string> Target::*member, const char* expected, bool is_path) {
  Json text_schema = Json::parse(kNonEmptyText);
  text_schema["pattern"] = kOneLinePattern;
  Json schema = {{"anyOf", Json::array({text_schema, ListOf(text_schema)})}};
  return {[=](const Json& value, const ConfigLocation& place, Target& config) {
            std::vector<std::string> texts;
            for (const Json& item : value.is_array() ? value : Json::array({value})) {
              if (!item.is_string() || item.get_ref<const std::string&>().empty() ||
                  HasControlCharacter(item.get<std::string>())) {
                return place.Expected(expected);
              }
              const auto text = item.get<std::string>();
              texts.push_back(is_path ? place.Resolve(text) : text);
            }
            config.*member = std::move(texts);
          },
          [=](const Target& config) { return (config.*member).empty() ? Json() : Json(config.*member); }, TextsToJson,
          std::move(schema)};
}

template <typename Target>
Codec<Target> OneLine(std::string Target::*member) {
  return Text(member, CheckOneLine, TextLike(kOneLinePattern));
}

}  // namespace terrace::config

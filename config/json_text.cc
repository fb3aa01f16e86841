#include "config/json_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace terrace::config {
namespace {

// Follows the parser through the text and reports keys that an object has twice: the library silently keeps the last.
class DuplicateKeyFinder {
 public:
  explicit DuplicateKeyFinder(std::vector<ConfigError>& errors) : errors_(errors) {}

  void OnEvent(Json::parse_event_t event, const Json& parsed) {
    switch (event) {
      case Json::parse_event_t::object_start:
      case Json::parse_event_t::array_start:
        Open(event == Json::parse_event_t::array_start);
        break;
      case Json::parse_event_t::key:
        OnKey(parsed.get<std::string>());
        break;
      case Json::parse_event_t::value:
        Advance();
        break;
      case Json::parse_event_t::object_end:
      case Json::parse_event_t::array_end:
        levels_.pop_back();
        Advance();
        break;
    }
  }

 private:
  struct Level {
    bool is_array = false;
    std::string path;  // of the container
    std::string key;   // of the current value in an object
    std::size_t index = 0;
    std::set<std::string> seen;
  };

  void Open(bool is_array) {
    std::string path;
    if (!levels_.empty()) {
      const Level& outer = levels_.back();
      path = AppendKey(outer.path, outer.is_array ? std::to_string(outer.index) : outer.key);
    }
    levels_.push_back({is_array, std::move(path), {}, 0, {}});
  }

  void OnKey(const std::string& key) {
    Level& level = levels_.back();
    level.key = key;
    if (!level.seen.insert(key).second)
      errors_.push_back({AppendKey(level.path, key), "appears twice; keep one of them"});
  }

  void Advance() {
    if (!levels_.empty()) ++levels_.back().index;
  }

  std::vector<ConfigError>& errors_;
  std::vector<Level> levels_;
};

// What the library says without its own names: "[json.exception.parse_error.101] parse error at line 3, column 5: what"
// and "[json.exception.out_of_range.406] what" become "what".
std::string Reason(std::string_view message) {
  if (const std::size_t start = message.find("syntax error"); start != std::string_view::npos)
    return std::string(message.substr(start));
  const std::size_t name_end = message.find("] ");
  return std::string(name_end == std::string_view::npos ? message : message.substr(name_end + 2));
}

bool IsUtf16(std::string_view text) {
  const auto starts = [&](char first, char second) { return text.size() > 1 && text[0] == first && text[1] == second; };
  return starts('\xFF', '\xFE') || starts('\xFE', '\xFF') || starts('{', '\0') || starts('\0', '{');
}

// What most often makes the parser stop at a place, said in other words than the parser's.
std::string HintOf(std::string_view text, std::size_t at, std::string_view reason) {
  if (IsUtf16(text)) return "; this is UTF-16: save it as UTF-8";
  const std::string_view before = text.substr(0, at), rest = text.substr(at);
  const auto follows = [&](std::string_view word) { return rest.substr(0, word.size()) == word; };
  const bool is_in_string = reason.find("invalid string") != std::string_view::npos;
  if (!is_in_string && (follows("#") || follows("//") || follows("/*"))) return "; JSON has no comments";
  const std::size_t last = before.find_last_not_of(" \t\r\n");
  if ((follows("}") || follows("]")) && last != std::string_view::npos && before[last] == ',')
    return "; take away the comma before it";
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");  // a byte order mark is no fault
  if (first != std::string_view::npos && text[first] != '{')
    return "; a configuration begins with {, and a DEM is served without --config (terrace serve dem.tif)";
  return {};
}

std::string DescribeFault(std::string_view text, std::size_t at, const std::string& reason) {
  const std::string_view before = text.substr(0, at);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t line_start = before.rfind('\n') == std::string_view::npos ? 0 : before.rfind('\n') + 1;
  return fmt::format("line {}, column {}: {}{}", line, at - line_start + 1, reason, HintOf(text, at, reason));
}

}  // namespace

Json ParseJsonText(std::string_view text, std::vector<ConfigError>& errors) {
  DuplicateKeyFinder duplicates(errors);
  const auto follow = [&](int, Json::parse_event_t event, Json& parsed) {
    duplicates.OnEvent(event, parsed);
    return true;
  };
  // To the parser it is the end of the text, whatever follows.
  if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos) {
    errors.push_back({"", DescribeFault(text, zero, "a byte of zero, which no text has")});
    return Json(Json::value_t::discarded);
  }
  try {
    return Json::parse(text, follow);
  } catch (const nlohmann::detail::parse_error& error) {
    // `byte` counts from 1 and is one past the end where the text stops too early.
    const std::size_t at = std::min(text.size(), error.byte == 0 ? 0 : error.byte - 1);
    errors.push_back({"", DescribeFault(text, at, Reason(error.what()))});
  } catch (const nlohmann::detail::exception& error) {
    errors.push_back({"", Reason(error.what())});
  }
  return Json(Json::value_t::discarded);
}

std::string AppendKey(const std::string& path, std::string_view key) {
  std::string result = path + '/';
  for (const char c : key) {
    if (c == '~') {
      result += "~0";
    } else if (c == '/') {
      result += "~1";
    } else {
      result += c;
    }
  }
  return result;
}

std::string Quote(const Json& value) {
  constexpr std::size_t kLongest = 60;
  std::string text = value.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace);
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

}  // namespace terrace::config

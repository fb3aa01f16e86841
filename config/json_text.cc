#include "config/json_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace terrace::config {
namespace {

// Makes the value as the library does, and reports keys that an object has twice, of which the library silently keeps
// the last. Not by the library's callback: to take values away that a callback refuses, that looks through the whole
// list at the end of each object in it.
class DuplicateKeyFinder : public nlohmann::detail::json_sax_dom_parser<Json> {
 public:
  DuplicateKeyFinder(Json& value, std::vector<ConfigError>& errors) : json_sax_dom_parser(value), errors_(errors) {}

  bool start_object(std::size_t size) {
    Open(/*is_array=*/false);
    return json_sax_dom_parser::start_object(size);
  }
  bool start_array(std::size_t size) {
    Open(/*is_array=*/true);
    return json_sax_dom_parser::start_array(size);
  }
  bool key(std::string& key) {
    Level& level = levels_.back();
    level.key = key;
    if (!level.seen.insert(key).second) {
      errors_.push_back({AppendKey(PathOf(level), key), "appears twice; keep one of them"});
    }
    return json_sax_dom_parser::key(key);
  }
  bool end_object() { return Close() && json_sax_dom_parser::end_object(); }
  bool end_array() { return Close() && json_sax_dom_parser::end_array(); }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& error) {
    // It counts from 1 and is one past the end where the text stops too early.
    fault_at_ = position == 0 ? 0 : position - 1;
    fault_ = error.what();
    return false;
  }
  std::size_t fault_at() const { return fault_at_; }
  const std::string& fault() const { return fault_; }

  bool null() { return Advance() && json_sax_dom_parser::null(); }
  bool boolean(bool value) { return Advance() && json_sax_dom_parser::boolean(value); }
  bool number_integer(std::int64_t value) { return Advance() && json_sax_dom_parser::number_integer(value); }
  bool number_unsigned(std::uint64_t value) { return Advance() && json_sax_dom_parser::number_unsigned(value); }
  bool number_float(double value, const std::string& text) {
    return Advance() && json_sax_dom_parser::number_float(value, text);
  }
  bool string(std::string& value) { return Advance() && json_sax_dom_parser::string(value); }

 private:
  struct Level {
    bool is_array = false;
    std::string key;        // of the current value in an object
    std::size_t index = 0;  // of the current value in a list
    std::set<std::string> seen;
  };

  // JSON Pointer to the object that is `innermost`.
  std::string PathOf(const Level& innermost) const {
    std::string path;
    for (const Level& level : levels_) {
      if (&level == &innermost) break;
      path = AppendKey(path, level.is_array ? std::to_string(level.index) : level.key);
    }
    return path;
  }

  void Open(bool is_array) { levels_.push_back({is_array, {}, 0, {}}); }
  bool Close() {
    levels_.pop_back();
    return Advance();
  }
  bool Advance() {
    if (!levels_.empty()) ++levels_.back().index;
    return true;
  }

  std::vector<ConfigError>& errors_;
  std::vector<Level> levels_;
  std::size_t fault_at_ = 0;
  std::string fault_;
};

// What the library says without its own names: "[json.exception.parse_error.101] parse error at line 3, column 5: what"
// and "[json.exception.out_of_range.406] what" become "what". Nor does it quote the text: a token may stand there.
std::string Reason(std::string_view message) {
  message = message.substr(0, message.find("; last read"));
  message = message.substr(0, message.find(" parsing '"));  // a number that is too large
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
  // To the parser it is the end of the text, whatever follows.
  if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos) {
    errors.push_back({"", DescribeFault(text, zero, "a byte of zero, which no text has")});
    return Json(Json::value_t::discarded);
  }
  Json value;
  DuplicateKeyFinder reader(value, errors);
  if (Json::sax_parse(text, &reader)) return value;
  errors.push_back({"", DescribeFault(text, std::min(text.size(), reader.fault_at()), Reason(reader.fault()))});
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

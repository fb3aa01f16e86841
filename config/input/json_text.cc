#include "config/input/json_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <set>
#include <utility>

namespace terrace::config {
namespace {

constexpr std::size_t kMaxKeys = 1000;  // of one object
constexpr std::size_t kMaxDepth = 100;  // nesting of lists and objects

// Reads a text and counts the bytes read.
class CountingIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  // `at`: advances with the bytes read.
  CountingIterator(const char* place, std::size_t& at) : place_(place), at_(&at) {}

  reference operator*() const { return *place_; }
  CountingIterator& operator++() {
    ++place_;
    ++*at_;
    return *this;
  }
  friend bool operator==(const CountingIterator& a, const CountingIterator& b) { return a.place_ == b.place_; }
  friend bool operator!=(const CountingIterator& a, const CountingIterator& b) { return a.place_ != b.place_; }

 private:
  const char* place_;
  std::size_t* at_;
};

// Computes line and column of ascending positions, in one pass through the text.
class LineCounter {
 public:
  explicit LineCounter(std::string_view text) : text_(text) {}

  // Precondition: `at` is not before the previous one.
  std::string PlaceOf(std::size_t at) {
    for (; at_ < std::min(at, text_.size()); ++at_) {
      if (text_[at_] != '\n') continue;
      ++line_;
      line_start_ = at_ + 1;
    }
    return fmt::format("line {}, column {}", line_, at - line_start_ + 1);
  }

 private:
  const std::string_view text_;
  std::size_t at_ = 0, line_ = 1, line_start_ = 0;
};

// Builds the value as the library does, and reports duplicate keys, of which the library silently keeps the last. Does
// not use the library's callback, which searches the whole list at the end of each object to remove refused values.
class DuplicateKeyFinder : public nlohmann::detail::json_sax_dom_parser<Json> {
 public:
  // `at`: number of bytes read.
  DuplicateKeyFinder(std::string_view text, const std::size_t& at, Json& value, std::vector<ConfigError>& errors)
      : json_sax_dom_parser(value), at_(at), lines_(text), errors_(errors) {}

  bool start_object(std::size_t size) {
    seen_.emplace_back();
    return Descend() && json_sax_dom_parser::start_object(size);
  }
  bool start_array(std::size_t size) { return Descend() && json_sax_dom_parser::start_array(size); }
  bool end_array() {
    --depth_;
    return json_sax_dom_parser::end_array();
  }
  bool key(std::string& key) {
    // The value keeps the order of keys, so each look-up takes linear time.
    if (seen_.back().size() >= kMaxKeys) {
      return Refuse(fmt::format("more than {} keys in one object; no configuration has that many", kMaxKeys));
    }
    // Named by its position, because the key may be any text.
    if (!seen_.back().insert(key).second && errors_.size() < kMaxConfigErrors) {
      errors_.push_back(
          {"", lines_.PlaceOf(at_ - 1) + ": the key that ends here stands twice in its object; keep one"});
    }
    return json_sax_dom_parser::key(key);
  }
  bool end_object() {
    --depth_;
    seen_.pop_back();
    return json_sax_dom_parser::end_object();
  }

  bool parse_error(std::size_t position, const std::string&, const nlohmann::detail::exception& error) {
    // The library counts from 1, and one past the end if the text is truncated.
    fault_at_ = position == 0 ? 0 : position - 1;
    fault_ = error.what();
    return false;
  }
  std::size_t fault_at() const { return fault_at_; }
  const std::string& fault() const { return fault_; }

 private:
  // A level takes more bytes of memory than its bracket takes of text.
  bool Descend() {
    if (++depth_ <= kMaxDepth) return true;
    return Refuse(fmt::format("lists or objects nested more than {} deep; no configuration is that deep", kMaxDepth));
  }
  bool Refuse(std::string why) {
    fault_at_ = at_ - 1;
    fault_ = std::move(why);
    return false;
  }

  const std::size_t& at_;
  LineCounter lines_;
  std::vector<ConfigError>& errors_;
  std::vector<std::set<std::string>> seen_;  // keys of each object that is open
  std::size_t depth_ = 0;
  std::size_t fault_at_ = 0;
  std::string fault_;
};

// The library's message without its prefixes: "[json.exception.parse_error.101] parse error at line 3, column 5: what"
// and "[json.exception.out_of_range.406] what" become "what". Also without quoted text, which may be a token.
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

// An explanation of the most frequent syntax errors.
std::string HintOf(std::string_view text, std::size_t at, std::string_view reason) {
  if (IsUtf16(text)) return "; this is UTF-16: save it as UTF-8";
  const std::string_view before = text.substr(0, at), rest = text.substr(at);
  const auto follows = [&](std::string_view word) { return rest.substr(0, word.size()) == word; };
  const bool is_in_string = reason.find("invalid string") != std::string_view::npos;
  if (!is_in_string && (follows("#") || follows("//") || follows("/*"))) return "; JSON has no comments";
  const std::size_t last = before.find_last_not_of(" \t\r\n");
  if ((follows("}") || follows("]")) && last != std::string_view::npos && before[last] == ',')
    return "; take away the comma before it";
  const std::size_t first = text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");  // a byte order mark is allowed
  if (first != std::string_view::npos && text[first] != '{')
    return "; a configuration begins with {, and a DEM is served without --config (terrace serve dem.tif)";
  return {};
}

std::string DescribeFault(std::string_view text, std::size_t at, const std::string& reason) {
  return fmt::format("{}: {}{}", LineCounter(text).PlaceOf(at), reason, HintOf(text, at, reason));
}

}  // namespace

Json ParseJsonText(std::string_view text, std::vector<ConfigError>& errors) {
  // The parser takes a null byte for the end of the text.
  if (const std::size_t zero = text.find('\0'); zero != std::string_view::npos) {
    errors.push_back({"", DescribeFault(text, zero, "a byte of zero, which no text has")});
    return Json(Json::value_t::discarded);
  }
  Json value;
  std::size_t at = 0;
  DuplicateKeyFinder reader(text, at, value, errors);
  const CountingIterator begin(text.data(), at), end(text.data() + text.size(), at);
  if (Json::sax_parse(begin, end, &reader)) return value;
  errors.push_back({"", DescribeFault(text, std::min(text.size(), reader.fault_at()), Reason(reader.fault()))});
  return Json(Json::value_t::discarded);
}

}  // namespace terrace::config

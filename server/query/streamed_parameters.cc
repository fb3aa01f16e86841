#include "server/query/streamed_parameters.h"

#include <algorithm>
#include <utility>

#include "server/http/text.h"

namespace terrace::server {
namespace {

class FormReader {
 public:
  FormReader(PlusSign plus, ParameterSink& sink) : plus_(plus), sink_(sink) {}

  // `at`: advances with the bytes read.
  Result<void> Read(std::string_view part, std::size_t& at) {
    const std::size_t begin = at;
    std::size_t plain = 0;  // beginning of the bytes that were not passed on yet; they need no decoding
    for (std::size_t i = 0; i < part.size(); ++i) {
      at = begin + i + 1;
      const char c = part[i];
      const bool is_special = digits_left_ > 0 || c == '%' || c == '&' || (c == '=' && in_name_) ||
                              (c == '+' && plus_ == PlusSign::kIsBlank);
      if (!is_special) continue;
      if (const Result<void> added = Add(part.substr(plain, i - plain)); !added) return added;
      if (const Result<void> taken = TakeSpecial(c); !taken) return taken;
      plain = i + 1;
    }
    return Add(part.substr(plain));
  }

  Result<void> End() {
    if (digits_left_ > 0) return Malformed();
    return EndPiece();
  }

 private:
  static tl::unexpected<Error> Malformed() {
    return MakeError(ErrorCode::kInvalidArgument, "malformed percent-encoding of a parameter");
  }

  Result<void> Add(std::string_view text) {
    if (text.empty()) return {};
    has_begun_ = true;
    return in_name_ ? sink_.AddToName(text) : sink_.AddToValue(text);
  }

  Result<void> TakeSpecial(char c) {
    if (digits_left_ > 0) return TakeDigit(c);
    if (c == '&') return EndPiece();
    if (c == '+') return Add(" ");
    if (c == '=') {
      in_name_ = false;
      has_begun_ = true;
      return sink_.EndName();
    }
    if (in_name_) {
      return MakeError(ErrorCode::kInvalidArgument, "a parameter's name has a percent sign; write it plainly");
    }
    digits_left_ = 2;
    byte_ = 0;
    return {};
  }

  Result<void> TakeDigit(char c) {
    const int digit = HexDigit(c);
    if (digit < 0) return Malformed();
    byte_ = byte_ * 16 + digit;
    if (--digits_left_ > 0) return {};
    if (byte_ < 0x20 || byte_ == 0x7f) return Malformed();
    const char decoded = static_cast<char>(byte_);
    return Add({&decoded, 1});
  }

  Result<void> EndPiece() {
    const bool had_begun = std::exchange(has_begun_, false), had_no_value = std::exchange(in_name_, true);
    if (!had_begun) return {};
    if (had_no_value) {
      if (const Result<void> named = sink_.EndName(); !named) return named;
    }
    return sink_.EndValue();
  }

  const PlusSign plus_;
  ParameterSink& sink_;
  bool in_name_ = true;     // in the name of a piece; else in its value
  bool has_begun_ = false;  // the piece is not empty
  int digits_left_ = 0, byte_ = 0;
};

}  // namespace

const std::string* TextOf(const SentTexts& texts, std::string_view name) {
  const auto sent = texts.find(name);
  return sent == texts.end() ? nullptr : &sent->second;
}

TextParts PartsOf(std::string_view text, std::stop_token stop) {
  return [text, stop = std::move(stop)]() mutable -> Result<std::string_view> {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the request any more");
    const std::string_view part = text.substr(0, kPartBytes);
    text.remove_prefix(part.size());
    return part;
  };
}

Result<void> ReadForm(const TextParts& next, PlusSign plus, ParameterSink& sink, std::size_t& at) {
  at = 0;
  FormReader reader(plus, sink);
  for (;;) {
    const Result<std::string_view> part = next();
    if (!part) return tl::unexpected(part.error());
    if (part->empty()) return reader.End();
    if (Result<void> read = reader.Read(*part, at); !read) return read;
  }
}

}  // namespace terrace::server

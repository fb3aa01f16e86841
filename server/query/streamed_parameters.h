// Readers of long lists of points and rays as named parameters: a URL's query or a form
// (application/x-www-form-urlencoded), and a flat JSON object. Other queries are read by ReadParameters (http/text.h).
// They parse the text once, part by part, and store nothing. The sink interprets names and values and limits their
// length; an error of the sink ends parsing at once.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <stop_token>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::server {

inline constexpr std::size_t kPartBytes = std::size_t{64} << 10;

// Returns the next part of a text, at most kPartBytes; empty at its end. An error ends parsing.
using TextParts = std::function<Result<std::string_view>()>;

// Divides `text`, which must outlive the parts. kCancelled: a stop was requested.
TextParts PartsOf(std::string_view text, std::stop_token stop);

// Receives the parameters one after the other. Names and values are decoded and arrive in any number of parts, also
// none.
class ParameterSink {
 public:
  virtual ~ParameterSink() = default;
  virtual Result<void> AddToName(std::string_view part) = 0;
  virtual Result<void> EndName() = 0;
  virtual Result<void> AddToValue(std::string_view part) = 0;
  virtual Result<void> EndValue() = 0;
  // A JSON object with the sink's parameters, for messages.
  virtual std::string_view JsonExample() const = 0;
};

// The values of parameters as sent, by name.
using SentTexts = std::map<std::string_view, std::string>;

// Null: the parameter was not sent.
const std::string* TextOf(const SentTexts& texts, std::string_view name);

enum class PlusSign { kIsPlus, kIsBlank };

// Parses name=value pairs separated by '&'. A piece without '=' has an empty value; empty pieces are skipped.
// Percent-encoding in values is decoded. kInvalidArgument: it is malformed or encodes a control character, or a name
// contains '%': no name here needs it, and proxies would not recognize the parameter. `at`: the number of bytes parsed.
Result<void> ReadForm(const TextParts& next, PlusSign plus, ParameterSink& sink, std::size_t& at);

// Parses a JSON object (RFC 8259) of texts and numbers; numbers are passed on as text, 3.0 as "3". Skips a byte order
// mark. kInvalidArgument: the text is something else; parsing ends at the first wrong byte. `at`: as above.
Result<void> ReadJsonObject(const TextParts& next, ParameterSink& sink, std::size_t& at);

}  // namespace terrace::server

// Readers of named parameters: a URL's query or a form (application/x-www-form-urlencoded), and a flat JSON object.
//
// They go through the text once, part by part, and keep nothing of it: what a name or a value is worth, and how long it
// may be, is the sink's business, and its error ends the reading at once.
#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::server {

inline constexpr std::size_t kPartBytes = std::size_t{64} << 10;

// The next part of a text, at most kPartBytes; empty at its end. An error ends the reading.
using TextParts = std::function<Result<std::string_view>()>;

// Parts of `text`, which has to outlive them. kCancelled: a stop was requested before a part.
TextParts PartsOf(std::string_view text, std::stop_token stop);

// Takes one parameter after the other. Names and values come decoded, in parts of any size; either may have none.
class ParameterSink {
 public:
  virtual ~ParameterSink() = default;
  virtual Result<void> AddToName(std::string_view part) = 0;
  virtual Result<void> EndName() = 0;
  virtual Result<void> AddToValue(std::string_view part) = 0;
  virtual Result<void> EndValue() = 0;
};

enum class PlusSign { kIsPlus, kIsBlank };

// Reads name=value pieces with '&' between them. A piece without '=' has an empty value; empty pieces are skipped.
// Percent-encoding is undone in values. kInvalidArgument: it is malformed, or encodes a control character; or there is
// a
// '%' in a name, as no name here needs one, and other readers on the way would not know the parameter.
// `at`: so many bytes were read when it ended.
Result<void> ReadForm(const TextParts& next, PlusSign plus, ParameterSink& sink, std::size_t& at);

// Reads a JSON object (RFC 8259) of texts and numbers; numbers come as they are written. kInvalidArgument: it is not
// that; ends at the first byte that says so. A byte order mark before it is skipped. `at` as above.
Result<void> ReadJsonObject(const TextParts& next, ParameterSink& sink, std::size_t& at);

}  // namespace terrace::server

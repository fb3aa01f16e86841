#include "server/query/points_input.h"

#include <algorithm>
#include <cstddef>

#include "server/http/text.h"

namespace terrace::server {
namespace {

bool HasMediaType(std::string_view content_type, std::string_view type) {
  return EqualsIgnoringCase(Trim(content_type.substr(0, content_type.find(';'))), type);
}

bool IsForm(std::string_view content_type) { return HasMediaType(content_type, "application/x-www-form-urlencoded"); }
bool IsJson(std::string_view content_type) { return HasMediaType(content_type, "application/json"); }

// Whether a body has no control characters. Forms may have bytes of UTF-8; binary floats nearly always have control
// characters.
bool IsText(std::string_view body) {
  return std::none_of(body.begin(), body.end(), [](char c) {
    const auto byte = static_cast<unsigned char>(c);
    return (byte < ' ' && c != '\t' && c != '\r' && c != '\n') || byte == 0x7F;
  });
}

}  // namespace

Result<void> ReadInput(const PointsInput& input, const std::stop_token& stop, ParameterSink& parameters) {
  std::size_t at = 0;
  Result<void> read = ReadForm(PartsOf(input.query, stop), PlusSign::kIsPlus, parameters, at);
  if (!read || input.content_type.empty() || IsBinaryBody(input.content_type)) return read;
  if (input.body.empty() && IsJson(input.content_type)) {
    return MakeError(ErrorCode::kInvalidArgument, "the body is empty; send a JSON object, such as {}",
                     parameters.JsonExample());
  }
  const TextParts parts = PartsOf(input.body, stop);
  read = IsForm(input.content_type) ? ReadForm(parts, PlusSign::kIsBlank, parameters, at)
                                    : ReadJsonObject(parts, parameters, at);
  if (!read && read.error().code == ErrorCode::kInvalidArgument) {
    const bool is_of_numbers = IsForm(input.content_type) && !IsText(input.body);
    return MakeError(ErrorCode::kInvalidArgument, "the body, byte {}: {}{}", at, read.error().message,
                     is_of_numbers ? "; the body was read as a form, as its Content-Type says, and is no text: send "
                                     "numbers with Content-Type: application/octet-stream"
                                   : "");
  }
  return read;
}

bool IsBinaryBody(std::string_view content_type) { return HasMediaType(content_type, "application/octet-stream"); }
bool IsPointsBody(std::string_view content_type) {
  return IsForm(content_type) || IsJson(content_type) || IsBinaryBody(content_type);
}

}  // namespace terrace::server

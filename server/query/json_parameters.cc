#include <algorithm>
#include <boost/json/basic_parser_impl.hpp>
#include <boost/json/src.hpp>  // the library's implementation, compiled here
#include <boost/system/errc.hpp>
#include <limits>
#include <utility>

#include "server/query/streamed_parameters.h"

namespace terrace::server {
namespace {

using boost::system::error_code;

// The handler of Boost.JSON's parser. The parser passes texts in parts, so that memory does not grow with the text.
class ObjectHandler {
 public:
  static constexpr std::size_t kUnlimited = std::numeric_limits<std::size_t>::max();
  // The library requires these names.
  static constexpr std::size_t max_object_size = kUnlimited, max_array_size = kUnlimited, max_key_size = kUnlimited,
                               max_string_size = kUnlimited;

  explicit ObjectHandler(ParameterSink& sink) : sink_(sink) {}

  const Result<void>& result() const { return result_; }

  bool on_document_begin(error_code&) { return true; }
  bool on_document_end(error_code&) { return true; }
  bool on_object_begin(error_code& error) {
    if (is_in_object_) return RefuseValue(error);
    is_in_object_ = true;
    return true;
  }
  bool on_object_end(std::size_t, error_code&) { return true; }
  bool on_array_begin(error_code& error) { return RefuseValue(error); }
  bool on_array_end(std::size_t, error_code&) { return true; }
  bool on_key_part(boost::json::string_view part, std::size_t, error_code& error) {
    return Take(sink_.AddToName({part.data(), part.size()}), error);
  }
  bool on_key(boost::json::string_view part, std::size_t size, error_code& error) {
    return on_key_part(part, size, error) && Take(sink_.EndName(), error);
  }
  bool on_string_part(boost::json::string_view part, std::size_t, error_code& error) { return Add(part, error); }
  bool on_string(boost::json::string_view part, std::size_t, error_code& error) { return End(part, error); }
  bool on_number_part(boost::json::string_view part, error_code& error) { return AddNumber(part, error); }
  bool on_int64(std::int64_t, boost::json::string_view part, error_code& error) { return EndNumber(part, error); }
  bool on_uint64(std::uint64_t, boost::json::string_view part, error_code& error) { return EndNumber(part, error); }
  bool on_double(double, boost::json::string_view part, error_code& error) { return EndNumber(part, error); }
  bool on_bool(bool, error_code& error) { return RefuseValue(error); }
  bool on_null(error_code& error) { return RefuseValue(error); }
  bool on_comment_part(boost::json::string_view, error_code&) { return true; }
  bool on_comment(boost::json::string_view, error_code&) { return true; }

 private:
  bool Take(Result<void> result, error_code& error) {
    if (result) return true;
    result_ = std::move(result);
    error = boost::system::errc::make_error_code(boost::system::errc::operation_canceled);
    return false;
  }
  bool RefuseValue(error_code& error) {
    if (!is_in_object_) return Take(MakeError(ErrorCode::kInvalidArgument, "this is not a JSON object"), error);
    return Take(
        MakeError(ErrorCode::kInvalidArgument, "values must be texts or numbers, such as {}", sink_.JsonExample()),
        error);
  }
  bool Add(boost::json::string_view part, error_code& error) {
    if (!is_in_object_) return RefuseValue(error);
    return Take(sink_.AddToValue({part.data(), part.size()}), error);
  }
  bool End(boost::json::string_view part, error_code& error) {
    return Add(part, error) && Take(sink_.EndValue(), error);
  }

  // 3.0 is the number 3, and some programs write it so: a fraction of zeros alone is left out.
  bool AddNumber(boost::json::string_view part, error_code& error) {
    if (held_ == 0) {
      const std::size_t point = std::min(part.find('.'), part.size());
      if (!Add(part.substr(0, point), error)) return false;
      part.remove_prefix(point);
      if (part.empty()) return true;
      part.remove_prefix(1);
      held_ = 1;
    }
    const std::size_t zeros = std::min(part.find_first_not_of('0'), part.size());
    held_ += zeros;
    part.remove_prefix(zeros);
    if (part.empty()) return true;
    if (!Add(".", error)) return false;
    while (--held_ > 0) {
      if (!Add("0", error)) return false;
    }
    return Add(part, error);  // a number has no second point
  }
  bool EndNumber(boost::json::string_view part, error_code& error) {
    if (!AddNumber(part, error)) return false;
    held_ = 0;
    return End("", error);
  }

  ParameterSink& sink_;
  bool is_in_object_ = false;
  std::size_t held_ = 0;  // the point and the zeros after it that were not added; 0: there was no point
  Result<void> result_;
};

}  // namespace

Result<void> ReadJsonObject(const TextParts& next, ParameterSink& sink, std::size_t& at) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  at = 0;
  boost::json::basic_parser<ObjectHandler> parser(boost::json::parse_options(), sink);
  for (;;) {
    const Result<std::string_view> part = next();
    if (!part) return tl::unexpected(part.error());
    std::string_view text = *part;
    const bool is_last = text.empty();
    if (at == 0 && text.starts_with(kByteOrderMark)) {
      text.remove_prefix(kByteOrderMark.size());
      at = kByteOrderMark.size();
    }
    error_code error;
    const std::size_t read = parser.write_some(!is_last, is_last ? "" : text.data(), text.size(), error);
    at += read;
    if (!parser.handler().result()) return parser.handler().result();
    if (error || read < text.size()) return MakeError(ErrorCode::kInvalidArgument, "this is no valid JSON");
    if (is_last) return {};
  }
}

}  // namespace terrace::server

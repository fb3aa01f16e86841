#include "server/http/request.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/fields.hpp>
#include <boost/beast/http/parser.hpp>
#include <charconv>
#include <optional>

#include "server/asio.h"

namespace terrace::server {
namespace {

namespace http = boost::beast::http;
using Fields = http::request_parser<http::empty_body>::value_type;

tl::unexpected<BadRequest> Bad(int status, std::string_view detail) {
  return tl::unexpected<BadRequest>(BadRequest{status, detail});
}

std::string Joined(const Fields& fields, http::field name) {
  std::string joined;
  const auto [begin, end] = fields.equal_range(name);
  for (auto field = begin; field != end; ++field) {
    if (!joined.empty()) joined += ", ";
    joined.append(field->value());
  }
  return joined;
}

Method ToMethod(http::verb verb) {
  switch (verb) {
    case http::verb::get:
      return Method::kGet;
    case http::verb::head:
      return Method::kHead;
    case http::verb::options:
      return Method::kOptions;
    case http::verb::post:
      return Method::kPost;
    default:
      return Method::kOther;
  }
}

// RFC 3986: host and port. An empty value is what a client sends whose URI has no authority.
bool IsHostValue(std::string_view value) {
  return std::all_of(value.begin(), value.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-._~%!$&'()*+,;=:[]").find(c) != std::string_view::npos;
  });
}

// Decimal, no sign, no leading zero, at most 15 digits; 0 without the field.
std::optional<std::size_t> PlainLength(const Fields& fields) {
  constexpr std::size_t kMaxDigits = 15;
  if (fields.count(http::field::content_length) == 0) return 0;
  const std::string_view text = fields[http::field::content_length];
  const bool plain = !text.empty() && text.size() <= kMaxDigits && (text == "0" || text[0] != '0') &&
                     std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (!plain) return std::nullopt;
  std::size_t length = 0;
  std::from_chars(text.data(), text.data() + text.size(), length);
  return length;
}

// Null when the message ends with its head or, of a POST, so many bytes after it. Beast reads a GET with
// `Transfer-Encoding: gzip` as body-less and takes what follows for another request; this is where that ends.
const char* FramingProblem(const Fields& fields) {
  if (fields.count(http::field::transfer_encoding) > 0) return "Transfer-Encoding is not accepted";
  const auto lengths = fields.count(http::field::content_length);
  if (lengths > 1) return "more than one Content-Length";
  if (lengths == 0 || fields[http::field::content_length] == "0") return nullptr;
  if (ToMethod(fields.method()) != Method::kPost) return "requests with a body are not accepted";
  return PlainLength(fields) ? nullptr : "malformed Content-Length";
}

const char* HostProblem(const Fields& fields) {
  const auto hosts = fields.count(http::field::host);
  if (hosts > 1) return "more than one Host";
  if (hosts == 0 && fields.version() >= 11) return "HTTP/1.1 needs a Host";
  if (hosts == 1 && !IsHostValue(fields[http::field::host])) return "malformed Host";
  return nullptr;
}

}  // namespace

tl::expected<std::size_t, BadRequest> FindHeadEnd(std::string_view bytes, std::size_t scanned) {
  const std::size_t from = std::max<std::size_t>(scanned, 3) - 3;  // the end may lie across two reads
  const std::size_t end = bytes.find("\r\n\r\n", from);
  const std::string_view head = bytes.substr(0, end);  // all of it when there is no end
  // The longest method that is answered, two spaces and " HTTP/1.1" around the target.
  const std::size_t first_line = head.find("\r\n");
  if (std::min(first_line, head.size()) > kMaxTargetBytes + 18) return Bad(414, "the request target is too long");
  if (end == std::string_view::npos ? bytes.size() >= kMaxHeadBytes : end + 4 > kMaxHeadBytes) {
    return Bad(431, "the request header is too large");
  }
  for (std::size_t at = head.find('\n', from); at != std::string_view::npos; at = head.find('\n', at + 1)) {
    if (at == 0 || head[at - 1] != '\r') return Bad(400, "a line ends without CR");
  }
  return end == std::string_view::npos ? 0 : end + 4;
}

tl::expected<Request, BadRequest> ParseHead(std::string_view head) {
  // Beast unfolds continued lines; another reader may see a field there.
  if (head.find("\r\n ") != std::string_view::npos || head.find("\r\n\t") != std::string_view::npos) {
    return Bad(400, "folded header lines are not accepted");
  }
  http::request_parser<http::empty_body> parser;
  parser.header_limit(kMaxHeadBytes);
  parser.body_limit(boost::none);  // FramingProblem decides
  boost::system::error_code error;
  parser.put(asio::buffer(head.data(), head.size()), error);
  if (!parser.is_header_done()) return Bad(400, "malformed request");

  const Fields& fields = parser.get();
  if (fields.target().size() > kMaxTargetBytes) return Bad(414, "the request target is too long");
  if (const char* problem = FramingProblem(fields)) return Bad(400, problem);
  if (const char* problem = HostProblem(fields)) return Bad(400, problem);

  Request request;
  request.method = ToMethod(fields.method());
  request.version = fields.version();
  request.keep_alive = fields.keep_alive();
  request.method_name = std::string(fields.method_string());
  request.target = std::string(fields.target());
  request.accept = Joined(fields, http::field::accept);
  request.accept_encoding = Joined(fields, http::field::accept_encoding);
  request.if_none_match = Joined(fields, http::field::if_none_match);
  request.referer = std::string(fields[http::field::referer]);
  request.user_agent = std::string(fields[http::field::user_agent]);
  request.content_type = std::string(fields[http::field::content_type]);
  request.content_length = *PlainLength(fields);
  // RFC 9110, section 10.1.1: HTTP/1.0 knows no interim replies.
  request.expects_continue =
      fields.version() >= 11 && boost::beast::iequals(fields[http::field::expect], "100-continue");
  request.host = std::string(fields[http::field::host]);
  request.forwarded_proto = std::string(fields["X-Forwarded-Proto"]);
  return request;
}

}  // namespace terrace::server

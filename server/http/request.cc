#include "server/http/request.h"

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/fields.hpp>
#include <boost/beast/http/parser.hpp>
#include <optional>

#include "server/asio.h"
#include "server/http/query.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

namespace http = boost::beast::http;
using Fields = http::request_parser<http::empty_body>::value_type;

tl::unexpected<BadRequest> Bad(int status, std::string_view detail) {
  return tl::unexpected<BadRequest>(BadRequest{status, detail});
}

template <typename Name>
std::string Joined(const Fields& fields, Name name) {
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

// 0 without the field.
std::optional<std::int64_t> PlainLength(const Fields& fields) {
  if (fields.count(http::field::content_length) == 0) return 0;
  return PlainDecimal(fields[http::field::content_length], /*max_digits=*/15);
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

// RFC 6750: the header, or the query.
std::string TokenOf(const Fields& fields, std::string& target) {
  constexpr std::string_view kScheme = "bearer ";
  const std::optional<std::string> in_query = TakeToken(target);
  const std::string_view authorization = fields[http::field::authorization];
  if (EqualsIgnoringCase(authorization.substr(0, kScheme.size()), kScheme)) {
    return std::string(Trim(authorization.substr(kScheme.size())));
  }
  return in_query.value_or("");
}

}  // namespace

bool IsHostValue(std::string_view value) {
  return std::all_of(value.begin(), value.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-._~%!$&'()*+,;=:[]").find(c) != std::string_view::npos;
  });
}

std::optional<std::string> TakeToken(std::string& target) {
  const std::size_t question = target.find('?');
  if (question == std::string::npos) return std::nullopt;
  std::string_view rest = std::string_view(target).substr(question + 1);
  std::optional<std::string> token;
  std::string kept;
  while (!rest.empty()) {
    const std::string_view piece = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(rest.size(), piece.size() + 1));
    const std::size_t equals = std::min(piece.find('='), piece.size());
    if (PercentDecode(piece.substr(0, equals)) == "token") {
      std::string value = PercentDecode(piece.substr(std::min(equals + 1, piece.size()))).value_or("");
      // No token has a blank in it.
      token = !token || *token == value ? std::move(value) : *token + " " + value;
    } else {
      kept.append(kept.empty() ? 0 : 1, '&').append(piece);
    }
  }
  if (!token) return std::nullopt;
  target.resize(question);
  if (!kept.empty()) target.append("?").append(kept);
  return token;
}

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
  request.token = TokenOf(fields, request.target);
  request.accept = Joined(fields, http::field::accept);
  request.accept_encoding = Joined(fields, http::field::accept_encoding);
  request.if_none_match = Joined(fields, http::field::if_none_match);
  const auto referer = fields[http::field::referer];
  request.referer = std::string(referer.substr(0, referer.find('?')));
  request.user_agent = std::string(fields[http::field::user_agent]);
  request.content_type = std::string(fields[http::field::content_type]);
  request.content_encoding = Joined(fields, http::field::content_encoding);
  request.content_length = static_cast<std::size_t>(*PlainLength(fields));
  // RFC 9110, section 10.1.1: HTTP/1.0 knows no interim replies.
  request.expects_continue =
      fields.version() >= 11 && boost::beast::iequals(fields[http::field::expect], "100-continue");
  request.host = std::string(fields[http::field::host]);
  request.origin = Joined(fields, http::field::origin);
  request.forwarded = Joined(fields, http::field::forwarded);
  request.forwarded_for = Joined(fields, "X-Forwarded-For");
  request.forwarded_host = Joined(fields, "X-Forwarded-Host");
  request.forwarded_proto = Joined(fields, "X-Forwarded-Proto");
  return request;
}

}  // namespace terrace::server

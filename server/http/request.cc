#include "server/http/request.h"

#include <algorithm>
#include <atomic>
#include <boost/asio/buffer.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/fields.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/rfc7230.hpp>
#include <boost/beast/http/verb.hpp>
#include <cstdint>
#include <optional>
#include <random>
#include <utility>

#include "server/asio/asio.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

namespace http = boost::beast::http;
using Fields = http::request_parser<http::empty_body>::value_type;

static_assert(kMaxTargetBytes == 8 * 1024 && kMaxHeadBytes == 16 * 1024);
constexpr std::string_view kLongTarget =
    "the request target has more than 8 KiB; many locations and rays fit into the body of a POST";
constexpr std::string_view kLongHead = "the head of the request has more than 16 KiB; send fewer or shorter headers";

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

// RFC 9112, section 9.3. Beast considers only the first Connection field.
bool WantsKeepAlive(const Fields& fields) {
  const std::string options = Joined(fields, http::field::connection);
  http::token_list tokens(options);
  if (tokens.exists("close")) return false;
  return fields.version() >= 11 || tokens.exists("keep-alive");
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

// 0 if the field is absent.
std::optional<std::int64_t> PlainLength(const Fields& fields) {
  if (fields.count(http::field::content_length) == 0) return 0;
  return PlainDecimal(fields[http::field::content_length], /*max_digits=*/15);
}

// Returns null if the message ends with its head or, for a POST, Content-Length bytes after it. Beast treats a GET
// with `Transfer-Encoding: gzip` as having no body and parses the following bytes as another request; this check
// prevents that.
const char* FramingProblem(const Fields& fields) {
  if (fields.count(http::field::transfer_encoding) > 0)
    return "Transfer-Encoding is not accepted; send the length of the body as Content-Length";
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

// RFC 6750.
std::optional<std::string> BearerOf(const Fields& fields) {
  constexpr std::string_view kScheme = "bearer ";
  const std::string_view authorization = fields[http::field::authorization];
  if (!EqualsIgnoringCase(authorization.substr(0, kScheme.size()), kScheme)) return std::nullopt;
  return std::string(Trim(authorization.substr(kScheme.size())));
}

RequestFields FieldsOf(const Fields& sent) {
  RequestFields fields;
  fields.accept = Joined(sent, http::field::accept);
  fields.accept_encoding = Joined(sent, http::field::accept_encoding);
  fields.if_none_match = Joined(sent, http::field::if_none_match);
  fields.host = std::string(sent[http::field::host]);
  fields.origin = Joined(sent, http::field::origin);
  fields.forwarded = Joined(sent, http::field::forwarded);
  fields.forwarded_for = Joined(sent, "X-Forwarded-For");
  fields.forwarded_host = Joined(sent, "X-Forwarded-Host");
  fields.forwarded_proto = Joined(sent, "X-Forwarded-Proto");
  fields.referer = std::string(sent[http::field::referer]);
  fields.user_agent = std::string(sent[http::field::user_agent]);
  fields.has_authorization = sent.count(http::field::authorization) > 0;
  fields.bearer = BearerOf(sent);
  fields.content_type = std::string(sent[http::field::content_type]);
  fields.content_encoding = Joined(sent, http::field::content_encoding);
  return fields;
}

// The parts of an unambiguous first line; other lines go through the full parser.
struct PlainLine {
  Method method;
  std::string_view name, target;
  std::size_t size;  // with its CR LF
};

std::optional<PlainLine> ReadPlainLine(std::string_view head) {
  constexpr std::string_view kVersion = " HTTP/1.1";
  const std::size_t size = head.find("\r\n");
  if (size == std::string_view::npos) return std::nullopt;
  std::string_view line = head.substr(0, size);
  const bool is_get = line.starts_with("GET ");
  if (!is_get && !line.starts_with("HEAD ")) return std::nullopt;
  if (!line.ends_with(kVersion)) return std::nullopt;
  const std::string_view name = line.substr(0, is_get ? 3 : 4);
  if (line.size() <= name.size() + 1 + kVersion.size()) return std::nullopt;
  const std::string_view target = line.substr(name.size() + 1, line.size() - name.size() - 1 - kVersion.size());
  if (target.size() > kMaxTargetBytes || target[0] != '/') return std::nullopt;
  if (!std::all_of(target.begin(), target.end(), [](char c) { return c > 0x20 && c < 0x7f; })) return std::nullopt;
  return PlainLine{is_get ? Method::kGet : Method::kHead, name, target, size + 2};
}

void Remember(std::string_view head, const Request& request, HeadMemo& memo) {
  const std::optional<PlainLine> line = ReadPlainLine(head);
  if (!line || request.content_length > 0 || request.expects_continue) {
    memo.bytes.clear();
    return;
  }
  memo.bytes = head.substr(line->size);
  memo.keep_alive = request.keep_alive;
  memo.fields = request.fields;
}

}  // namespace

RequestId RequestId::Next() {
  static const std::uint64_t start = std::uint64_t{std::random_device{}()} << 32;
  static std::atomic<std::uint64_t> count{0};
  std::uint64_t number = start + count.fetch_add(1, std::memory_order_relaxed);
  RequestId id;
  id.size_ = id.digits_.size();
  for (auto digit = id.digits_.rbegin(); digit != id.digits_.rend(); ++digit, number >>= 4) {
    *digit = "0123456789abcdef"[number & 15];
  }
  return id;
}

SharedFields::SharedFields() {
  static const auto none = std::make_shared<const RequestFields>();
  fields_ = none;
}

void SharedFields::Set(std::string RequestFields::*field, std::string value) {
  auto own = std::make_shared<RequestFields>(*fields_);
  (*own).*field = std::move(value);
  fields_ = std::move(own);
}

bool IsHostValue(std::string_view value) {
  return std::all_of(value.begin(), value.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("-._~%!$&'()*+,;=:[]").find(c) != std::string_view::npos;
  });
}

tl::expected<std::size_t, BadRequest> FindHeadEnd(std::string_view bytes, std::size_t scanned) {
  const std::size_t from = std::max<std::size_t>(scanned, 3) - 3;  // the end may be split between two reads
  const std::size_t end = bytes.find("\r\n\r\n", from);
  const std::string_view head = bytes.substr(0, end);  // all of it if there is no end
  if (end == std::string_view::npos ? bytes.size() >= kMaxHeadBytes : end + 4 > kMaxHeadBytes) {
    // The first line may have 17 bytes more than the target: "OPTIONS " and " HTTP/1.1".
    const bool is_long_target = std::min(head.find("\r\n"), head.size()) > kMaxTargetBytes + 17;
    return is_long_target ? Bad(414, kLongTarget) : Bad(431, kLongHead);
  }
  for (std::size_t at = head.find('\n', from); at != std::string_view::npos; at = head.find('\n', at + 1)) {
    if (at == 0 || head[at - 1] != '\r') return Bad(400, "a line ends without CR");
  }
  return end == std::string_view::npos ? 0 : end + 4;
}

std::size_t TakeRepeated(std::string_view bytes, const HeadMemo& memo, Request& request) {
  if (memo.bytes.empty()) return 0;
  const std::optional<PlainLine> line = ReadPlainLine(bytes);
  if (!line || !bytes.substr(line->size).starts_with(memo.bytes)) return 0;
  if (line->size + memo.bytes.size() > kMaxHeadBytes) return 0;
  request = Request();
  request.method = line->method;
  request.method_name = line->name;
  request.keep_alive = memo.keep_alive;
  request.fields = memo.fields;
  request.target = std::string(line->target);
  return line->size + memo.bytes.size();
}

namespace {

// The value of the only Origin line of a message that was not parsed; empty if there is none or more than one.
std::string OriginOf(std::string_view bytes) {
  constexpr std::string_view kName = "origin:", kLineEnd = "\r\n";
  std::string origin;
  for (std::size_t at = bytes.find(kLineEnd); at != std::string_view::npos; at = bytes.find(kLineEnd, at + 1)) {
    const std::string_view line = bytes.substr(at + kLineEnd.size());
    const std::size_t end = line.find(kLineEnd);
    if (end == 0 || end == std::string_view::npos) break;  // of the head, or of what has arrived
    if (!EqualsIgnoringCase(line.substr(0, kName.size()), kName)) continue;
    if (!origin.empty()) return {};
    origin = Trim(line.substr(kName.size(), end - kName.size()));
  }
  return origin;
}

}  // namespace

Request RefusedRequestOf(std::string_view bytes) {
  Request request;
  request.method = Method::kOther;
  request.fields.Set(&RequestFields::origin, OriginOf(bytes));
  std::string_view line = bytes.substr(0, bytes.find_first_of("\r\n"));
  const std::size_t blank = line.find(' ');
  const std::string_view method = line.substr(0, blank);
  if (blank == std::string_view::npos || method.size() > 32 ||
      !std::all_of(method.begin(), method.end(), [](char c) { return (c >= 'A' && c <= 'Z') || c == '-'; })) {
    return request;
  }
  request.method_name = std::string(method);
  request.method = ToMethod(http::string_to_verb(method));
  line.remove_prefix(blank + 1);
  request.target = std::string(line.substr(0, line.find(' ')));
  return request;
}

tl::expected<Request, BadRequest> ParseHead(std::string_view head, HeadMemo* memo) {
  // Beast unfolds continued lines; another parser may see a field there.
  if (head.find("\r\n ") != std::string_view::npos || head.find("\r\n\t") != std::string_view::npos) {
    return Bad(400, "folded header lines are not accepted");
  }
  http::request_parser<http::empty_body> parser;
  parser.header_limit(kMaxHeadBytes);
  parser.body_limit(boost::none);  // FramingProblem decides
  boost::system::error_code error;
  parser.put(asio::buffer(head.data(), head.size()), error);
  if (!parser.is_header_done()) {
    return Bad(400,
               "malformed request; usual causes: a blank in the target (write %20), a header line without a colon or "
               "with a control character, another version than HTTP/1.0 and 1.1");
  }

  const Fields& fields = parser.get();
  if (fields.target().size() > kMaxTargetBytes) return Bad(414, kLongTarget);
  if (const char* problem = FramingProblem(fields)) return Bad(400, problem);
  if (const char* problem = HostProblem(fields)) return Bad(400, problem);

  Request request;
  request.method = ToMethod(fields.method());
  request.version = fields.version();
  request.keep_alive = WantsKeepAlive(fields);
  request.method_name = std::string(fields.method_string());
  RequestFields said = FieldsOf(fields);
  // RFC 9112, section 3.2.2: the host of an absolute target overrides Host. Remember() refuses such targets.
  if (const std::optional<std::string_view> rest = AfterScheme(fields.target())) {
    said.host = std::string(rest->substr(0, rest->find_first_of("/?#")));
    if (said.host.empty() || !IsHostValue(said.host)) return Bad(400, "malformed host in the request target");
  }
  request.fields = SharedFields(std::move(said));
  request.target = std::string(fields.target());
  request.content_length = static_cast<std::size_t>(*PlainLength(fields));
  // RFC 9110, section 10.1.1: HTTP/1.0 has no interim replies.
  request.expects_continue =
      fields.version() >= 11 && boost::beast::iequals(fields[http::field::expect], "100-continue");
  if (memo != nullptr) Remember(head, request, *memo);
  return request;
}

}  // namespace terrace::server

// One HTTP request. Requests from the network are made by ParseHead, or by TakeRepeated, which takes over the header
// fields of the request before.
//
// Parsing is stricter than RFC 9112 wherever two readers could disagree about the end of a message: only a POST may
// announce a body, by a single Content-Length in plain decimals. Any other message that announces a body is refused
// before further bytes are read.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>

namespace terrace::server {

inline constexpr std::size_t kMaxHeadBytes = 16 * 1024;
inline constexpr std::size_t kMaxTargetBytes = 8 * 1024;

enum class Method { kGet, kHead, kOptions, kPost, kOther };

// The header fields of a request, without those of its framing.
struct RequestFields {
  // Several fields of one name are joined with ", ", except Authorization, Host, Referer, User-Agent
  // and Content-Type.
  std::string accept;
  std::string accept_encoding;
  std::string if_none_match;
  std::string host;  // host and port: letters, digits and "-._~%!$&'()*+,;=:[]"; may be empty
  std::string origin;
  // Written by a proxy in front of the server, or by the client.
  std::string forwarded, forwarded_for, forwarded_host, forwarded_proto;
  std::string referer, user_agent;    // for the log
  bool has_authorization = false;     // of whatever scheme
  std::optional<std::string> bearer;  // of the Authorization header; a secret
  std::string content_type;
  std::string content_encoding;

  friend bool operator==(const RequestFields&, const RequestFields&) = default;
};

// Shared by a connection's requests with equal fields. Most requests of a connection are alike.
class SharedFields {
 public:
  SharedFields();  // empty ones
  explicit SharedFields(RequestFields fields) : fields_(std::make_shared<const RequestFields>(std::move(fields))) {}

  const RequestFields& operator*() const { return *fields_; }
  const RequestFields* operator->() const { return fields_.get(); }
  // Changes this request's fields only.
  void Set(std::string RequestFields::*field, std::string value);

 private:
  std::shared_ptr<const RequestFields> fields_;  // never null
};

// Sixteen hexadecimal digits that identify a request in the log and to its client; empty until assigned.
class RequestId {
 public:
  RequestId() = default;
  static RequestId Next();  // unique in the process, and very likely across processes

  operator std::string_view() const { return {digits_.data(), size_}; }  // NOLINT(google-explicit-constructor)
  bool empty() const { return size_ == 0; }

 private:
  std::array<char, 16> digits_{};
  std::size_t size_ = 0;
};

// The body of a request, shared by copies of the request and by jobs that read it. Its memory counts against the budget
// until the last of them is gone.
class RequestBody {
 public:
  RequestBody() = default;
  explicit RequestBody(std::shared_ptr<const std::string> text) : text_(std::move(text)) {}

  operator std::string_view() const {  // NOLINT(google-explicit-constructor)
    return text_ ? std::string_view(*text_) : std::string_view();
  }
  std::size_t size() const { return text_ ? text_->size() : 0; }

  friend bool operator==(const RequestBody& a, const RequestBody& b) {
    return std::string_view(a) == std::string_view(b);
  }

 private:
  std::shared_ptr<const std::string> text_;
};

struct Request {
  Method method = Method::kGet;
  unsigned version = 11;    // 10 or 11
  bool keep_alive = true;   // what the client wants
  std::string method_name;  // as sent, for the log
  std::string target;       // as sent; ConnectionHandler::Admit removes a token
  SharedFields fields;
  std::size_t content_length = 0;  // of a POST
  bool expects_continue = false;   // the client waits for a 100 before it sends the body
  RequestBody body;                // of a POST, once the session has read it

  // Assigned by the server.
  RequestId id;
  // When all waiting and work for this request ends. The time in which its body arrives does not count.
  std::chrono::steady_clock::time_point deadline = std::chrono::steady_clock::time_point::max();
  bool is_https = false;     // how the client speaks to this server, or to the proxy before it
  bool is_private = true;    // shared caches must not keep the reply
  std::uint64_t client = 0;  // identifies the client to the fair queue and to memory limits
};

// Why bytes are not a request. The connection cannot be used afterwards, because its framing cannot be trusted.
struct BadRequest {
  int status = 400;         // 400, 408, 414 or 431; of RequestReader::ReadBody also 0
  std::string_view detail;  // for the client; a literal
};

// Returns the end of the head in `bytes` (just past the empty line), 0 if the head is incomplete, or why it can never
// be a head. The first `scanned` bytes were examined by an earlier call.
tl::expected<std::size_t, BadRequest> FindHeadEnd(std::string_view bytes, std::size_t scanned);

// The method and the beginning of the target from the first line of a message that is refused, as far as they can be
// read; kOther and no target if they cannot. Of the fields, the Origin alone, which lets a page read the reply. For the
// log and for the form of the reply. The request is not served.
Request RefusedRequestOf(std::string_view bytes);

// The header of a connection's previous request, as bytes; none if that had a body, `Expect: 100-continue` or an
// unusual first line. For a next request with the same header only the first line is parsed.
struct HeadMemo {
  std::string bytes;  // all after the first line; empty: none
  bool keep_alive = true;
  SharedFields fields;
};

// `head` ends with its empty line. Sets everything but `body` and the members assigned by the server. Stores the header
// in `memo`, which may be null, if the next request may repeat it.
tl::expected<Request, BadRequest> ParseHead(std::string_view head, HeadMemo* memo = nullptr);

// If `bytes` begin with a complete head with the header of `memo`: returns its size, and sets the request to the result
// of ParseHead. Otherwise returns 0; call FindHeadEnd and ParseHead then.
std::size_t TakeRepeated(std::string_view bytes, const HeadMemo& memo, Request& request);

// Whether it has only characters that a host and port may have (RFC 3986), or is empty. Clients whose URI has no
// authority send an empty value.
bool IsHostValue(std::string_view value);

}  // namespace terrace::server

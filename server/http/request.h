// One HTTP request, and the only way to get its head out of bytes from the network.
//
// Stricter than RFC 9112 wherever two readers of the same bytes could disagree about where a message ends: only a POST
// may announce a body, by one Content-Length in plain decimals; any other message that announces one is refused before
// another byte is read.
#pragma once

#include <array>
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

// What the header of a request says, but for its framing.
struct RequestFields {
  std::string accept;  // several fields joined with ", ", here and below
  std::string accept_encoding;
  std::string if_none_match;
  std::string host;  // host and port: letters, digits and "-._~%!$&'()*+,;=:[]"; may be empty
  std::string origin;
  // What a proxy before the server may have written, or the client.
  std::string forwarded, forwarded_for, forwarded_host, forwarded_proto;
  std::string referer, user_agent;    // for the log
  bool has_authorization = false;     // of whatever scheme
  std::optional<std::string> bearer;  // of the Authorization header; a secret
  std::string content_type;
  std::string content_encoding;

  friend bool operator==(const RequestFields&, const RequestFields&) = default;
};

// Shared by the requests of a connection that say the same, as nearly all do.
class SharedFields {
 public:
  SharedFields();  // empty ones
  explicit SharedFields(RequestFields fields) : fields_(std::make_shared<const RequestFields>(std::move(fields))) {}

  const RequestFields& operator*() const { return *fields_; }
  const RequestFields* operator->() const { return fields_.get(); }
  // The others keep theirs.
  void Set(std::string RequestFields::*field, std::string value);

 private:
  std::shared_ptr<const RequestFields> fields_;  // never null
};

// Sixteen hexadecimal digits that name a request in the log and in what its client is told; empty until it is given.
class RequestId {
 public:
  RequestId() = default;
  static RequestId Next();  // another one at every call, of every process

  operator std::string_view() const { return {digits_.data(), size_}; }  // NOLINT(google-explicit-constructor)
  bool empty() const { return size_ == 0; }

 private:
  std::array<char, 16> digits_{};
  std::size_t size_ = 0;
};

// The body of a request, shared by the request's copies and by jobs that read it. What its memory counts against is
// told when the last of them is gone.
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
  std::string target;       // as sent, until it is admitted
  SharedFields fields;
  std::size_t content_length = 0;  // of a POST
  bool expects_continue = false;   // the client waits for a 100 before it sends the body
  RequestBody body;                // of a POST, once the session has read it

  // Given by the server.
  RequestId id;
  bool is_https = false;     // how the client speaks to this server, or to the proxy before it
  bool is_private = true;    // the reply is for its sender alone
  std::uint64_t client = 0;  // who takes turns with others
};

// Why bytes are not a request. The connection is of no use afterwards: its framing cannot be trusted.
struct BadRequest {
  int status = 400;         // 400, 408, 414 or 431
  std::string_view detail;  // for the client; a literal
};

// Where the head in `bytes` ends (just past the empty line), 0 if it is not complete yet, or why it never can be.
// `scanned` bytes were looked at by an earlier call with the same beginning.
tl::expected<std::size_t, BadRequest> FindHeadEnd(std::string_view bytes, std::size_t scanned);

// What the first line of `bytes` says of a message that is refused, for the log and for the form of the reply: its
// method and the beginning of its target, as far as they can be told; kOther and nothing else where they cannot.
// Nothing of it is answered.
Request FirstLineOf(std::string_view bytes);

// The header of a connection's last request without a body, byte by byte: the next one that repeats it needs no parsing
// but of its first line.
struct HeadMemo {
  std::string bytes;  // all behind the first line; empty: nothing to repeat
  bool keep_alive = true;
  SharedFields fields;
};

// `head` ends with its empty line. Sets everything but `body` and what is given by the server. What of it the next
// request may repeat is left in `memo`, which may be null.
tl::expected<Request, BadRequest> ParseHead(std::string_view head, HeadMemo* memo = nullptr);

// Where `bytes` begin with a whole head that repeats `memo`: its size, and the request that ParseHead would make of it.
// 0: FindHeadEnd and ParseHead have to look.
std::size_t TakeRepeated(std::string_view bytes, const HeadMemo& memo, Request& request);

// Whether it is a host and port after RFC 3986, or empty, which is what a client sends whose URI has no authority.
bool IsHostValue(std::string_view value);

}  // namespace terrace::server

// One HTTP request, and the only way to get its head out of bytes from the network.
//
// Stricter than RFC 9112 wherever two readers of the same bytes could disagree about where a message ends: only a POST
// may announce a body, by one Content-Length in plain decimals; any other message that announces one is refused before
// another byte is read.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace terrace::server {

inline constexpr std::size_t kMaxHeadBytes = 16 * 1024;
inline constexpr std::size_t kMaxTargetBytes = 8 * 1024;

enum class Method { kGet, kHead, kOptions, kPost, kOther };

struct Request {
  Method method = Method::kGet;
  unsigned version = 11;    // 10 or 11
  bool keep_alive = true;   // what the client wants
  std::string method_name;  // as sent, for the log
  std::string target;       // as sent
  std::string accept;       // several fields joined with ", "
  std::string accept_encoding;
  std::string if_none_match;
  std::string host;                 // host and port: letters, digits and "-._~%!$&'()*+,;=:[]"; may be empty
  std::string forwarded_proto;      // of a proxy before the server: "https", "http", or whatever else was sent
  std::string referer, user_agent;  // for the log
  std::string content_type;
  std::size_t content_length = 0;  // of a POST
  bool expects_continue = false;   // the client waits for a 100 before it sends the body
  std::string body;                // of a POST, once the session has read it
  std::string id;                  // 16 hexadecimal digits, given by the server
};

// Why bytes are not a request. The connection is of no use afterwards: its framing cannot be trusted.
struct BadRequest {
  int status = 400;         // 400, 414 or 431
  std::string_view detail;  // for the client; a literal
};

// Where the head in `bytes` ends (just past the empty line), 0 if it is not complete yet, or why it never can be.
// `scanned` bytes were looked at by an earlier call with the same beginning.
tl::expected<std::size_t, BadRequest> FindHeadEnd(std::string_view bytes, std::size_t scanned);

// `head` ends with its empty line. Sets everything but `id` and `body`.
tl::expected<Request, BadRequest> ParseHead(std::string_view head);

}  // namespace terrace::server

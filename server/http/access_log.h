// One line of log for every reply.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace terrace::server {

// What is told about a reply when its last byte was handed to the kernel. Valid during the call only.
struct ReplyRecord {
  std::string_view method;
  std::string_view target;  // as sent by the client: anything may be in it
  int status = 0;           // 499: the client left before there was a reply
  std::size_t body_bytes = 0;
  std::chrono::microseconds duration{0};  // from the end of the request's head
  std::string_view route;                 // a literal
  std::string_view cache;                 // hit, miss, join or -
  std::string_view request_id;
  std::string_view peer;
  std::string_view client;      // whom a trusted proxy speaks for; empty where the peer is the client
  std::string_view token_name;  // empty: none
};

inline constexpr std::size_t kMaxLoggedTargetBytes = 512;

// GET "/maui/0/0/0.terrain" 200 4711 B 12.345 ms cache=miss id=0123456789abcdef peer=127.0.0.1:4242
// and client= and token= where there are such.
// Quotes, backslashes and whatever is not printable ASCII appear as \xHH, so that a line is one line.
std::string FormatAccessLine(const ReplyRecord& record);

}  // namespace terrace::server

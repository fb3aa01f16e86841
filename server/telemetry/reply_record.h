// What the access log and the metrics say of a reply.
#pragma once

#include <chrono>
#include <cstddef>
#include <string_view>

namespace terrace::server {

struct SentReply;  // server/http/application.h

// A reply that was sent, or status 499. Views of the SentReply. Text sent by the client may contain any bytes.
struct ReplyRecord {
  std::string_view method;
  std::string_view target;  // as sent by the client; logged in the form of RedactTarget
  unsigned version = 11;    // of HTTP: 10 or 11
  int status = 0;           // 499: the client left before there was a reply
  std::size_t body_bytes = 0;
  std::chrono::microseconds duration{0};  // from the end of the request's head
  std::string_view route;                 // a literal
  std::string_view dataset;               // an existing dataset, or empty
  // Where the tile was: hit, miss, join, the name of the tier that had it (tiler::StoreBase::name), or -.
  std::string_view cache;
  std::string_view error;  // the kind of the failure behind the reply (ToString of its ErrorCode); empty: none
  std::string_view request_id;
  std::string_view peer;                 // address and port
  std::string_view client;               // the client that a trusted proxy reports; empty if the peer is the client
  std::string_view token_name;           // empty: none
  std::string_view referer, user_agent;  // as sent; the referer is logged in the form of RedactReferer
};

// All but the client and the token, which admission decides. Valid as long as `reply`.
ReplyRecord RecordOf(const SentReply& reply);

}  // namespace terrace::server

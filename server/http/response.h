// One HTTP reply, and the bytes of its head.
//
// Nothing of a request's text ever becomes a header: names are literals and values are numbers, literals or ETags that
// the server made.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/cors.h"
#include "server/http/request.h"

namespace terrace::server {

// Shared with whoever else holds it; a tile's body is never copied.
using Body = std::shared_ptr<const std::string>;

struct Response {
  int status = 200;
  std::string_view content_type;      // a literal; empty where there is no body
  Body body;                          // null: empty
  std::string_view content_encoding;  // a literal; empty: none
  std::string etag;                   // with its quotes; may be empty
  std::string cache_control;          // may be empty
  bool vary = false;                  // the reply depends on Accept and Accept-Encoding
  std::string_view vary_too;          // a literal: further headers it depends on; may be empty
  bool for_grant = false;             // another token, or none, would be answered otherwise
  bool close = false;                 // end the connection after this reply
  bool is_vital = false;              // tells how the server is: goes out where other replies find no room

  struct Header {
    Header(std::string_view n, std::string v) : name(n), value(std::move(v)) {}

    std::string_view name;  // a literal
    std::string value;
  };
  std::vector<Header> headers;

  // Lines that were made beforehand, each with its CR LF, in place of content_type, content_encoding and etag; null:
  // none.
  std::shared_ptr<const std::string> lines;
  std::size_t lines_of_body =
      0;                        // so many bytes at their front describe the body: a reply without one leaves them away
  std::string_view more_lines;  // a literal: further ones, each with its CR LF

  bool try_again = false;  // a 503 that another try, a moment later, may turn into an answer

  // What the application's log and metrics call the reply; HTTP hands it on unread.
  struct Labels {
    std::string_view route = "none";  // literals
    std::string_view cache = "-";
    std::string subject;  // what was asked about, if there is such
  } labels;
};

// What a reply's head says beyond the response itself.
struct HeadOptions {
  unsigned version = 11;  // the request's: an HTTP/1.0 client that is told 1.1 waits for ever
  bool keep_alive = false;
  bool is_private = false;           // the request may hold a secret: caches that others share must not keep the reply
  const CorsPolicy* cors = nullptr;  // null: any page may read the reply
  std::string_view origin = {};      // the request's
};

std::string SerializeHead(const Response& response, const HeadOptions& options);

// Cache-Control of a reply for one client alone: otherwise as configured.
std::string PrivateCacheControl(std::string_view configured);

// 204 to an OPTIONS request: what a browser asks before it sends a request with headers of its own.
Response PreflightResponse(bool takes_post);

// As the Allow header lists them.
std::string MethodsOf(bool takes_post);

// Turns a 200 into a 304 where the request's If-None-Match names its ETag.
Response Conditional(Response response, const Request& request);

// RFC 9110, section 13.1.2: a list of ETags, weakly compared, or "*".
bool MatchesEtag(std::string_view if_none_match, std::string_view etag);

}  // namespace terrace::server

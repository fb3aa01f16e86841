// One HTTP reply, and the bytes of its head.
//
// No header contains text of a request: names are literals; values are numbers, literals or ETags that the server made.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/cors.h"
#include "server/http/request.h"

namespace terrace::server {

// Shared, so that a tile's body is never copied.
using Body = std::shared_ptr<const std::string>;

struct Response {
  int status = 200;
  std::string_view content_type;      // a literal; empty where there is no body
  Body body;                          // null: empty
  std::string_view content_encoding;  // a literal; empty: none
  std::string etag;                   // with its quotes; may be empty
  std::string cache_control;          // may be empty
  std::string_view vary;              // a literal: the request headers that the reply depends on; may be empty
  std::string_view vary_more;         // a literal: further request headers; may be empty
  bool depends_on_token = false;      // the reply depends on the request's token
  bool close = false;                 // end the connection after this reply
  bool is_vital = false;              // reports the server's state: may use memory beyond the limits of other replies

  struct Header {
    Header(std::string_view n, std::string v) : name(n), value(std::move(v)) {}

    std::string_view name;  // a literal
    std::string value;
  };
  std::vector<Header> headers;

  // Prepared header lines, each with its CR LF. They replace content_type, content_encoding and etag. Null: none.
  std::shared_ptr<const std::string> lines;
  // How many bytes at the beginning of `lines` describe the body; replies without a body omit them.
  std::size_t bytes_about_body = 0;
  std::string_view literal_lines;  // a literal: further header lines, each with its CR LF

  bool try_again = false;  // a 503 that may succeed if it is retried shortly after

  // Labels for the application's log and metrics. HTTP passes them on unread.
  struct Labels {
    std::string_view route = "none";  // literals
    std::string_view cache = "-";
    std::string_view error;  // the kind of the failure behind the reply (ToString of its ErrorCode); empty: none
    std::string subject;     // the dataset of the request; empty: none
  } labels;
};

// What a reply's head depends on besides the response.
struct HeadOptions {
  unsigned version = 11;  // the request's: an HTTP/1.0 client would wait forever for the end of a 1.1 reply
  bool keep_alive = false;
  bool is_private = false;           // the request may contain a secret: shared caches must not keep the reply
  const CorsPolicy* cors = nullptr;  // null: any page may read the reply
  std::string_view origin = {};      // the request's
};

std::string SerializeHead(const Response& response, const HeadOptions& options);

// Cache-Control of a reply for one client alone, made from the configured value.
std::string PrivateCacheControl(std::string_view configured);

// 204: the reply to an OPTIONS request, which browsers send before a request with non-standard headers.
Response PreflightResponse(bool takes_post);

// The value of the Allow header.
std::string MethodsOf(bool takes_post);

// Turns a 200 into a 304 if the request's If-None-Match names its ETag.
Response Conditional(Response response, const Request& request);

// RFC 9110, section 13.1.2: a list of ETags, weakly compared, or "*".
bool MatchesEtag(std::string_view if_none_match, std::string_view etag);

// Like MatchesEtag, but "*" does not match: for replies that are not made yet. A client that names the ETag has had the
// reply; with "*" the request may still be refused (RFC 9110, section 13.2.1).
bool NamesEtag(std::string_view if_none_match, std::string_view etag);

}  // namespace terrace::server

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

#include "server/http/request.h"
#include "server/tiles/tile_request.h"

namespace terrace::server {

// Shared with whoever else holds it; a tile's body is never copied.
using Body = std::shared_ptr<const std::string>;

struct Response {
  int status = 200;
  std::string_view content_type;  // a literal; empty where there is no body
  Body body;                      // null: empty
  Coding coding = Coding::kIdentity;
  std::string etag;           // with its quotes; may be empty
  std::string cache_control;  // may be empty
  bool vary = false;          // the reply depends on Accept and Accept-Encoding
  bool close = false;         // end the connection after this reply

  struct Header {
    Header(std::string_view n, std::string v) : name(n), value(std::move(v)) {}

    std::string_view name;  // a literal
    std::string value;
  };
  std::vector<Header> headers;

  bool source_changed = false;  // why it is a 503: whoever opens the source anew can answer

  // For the log and the metrics.
  std::string_view route = "none";
  std::string_view cache = "-";
  std::string dataset;  // the one that was asked about, if it exists
};

// The header values that every reply carries, so that any web page may read it: CORS and resource timing.
// `version` is the request's: an HTTP/1.0 client that is told 1.1 waits for ever.
std::string SerializeHead(const Response& response, unsigned version, bool keep_alive);

// 204 to an OPTIONS request: what a browser asks before it sends a request with headers of its own.
Response PreflightResponse(bool takes_post);

// As the Allow header lists them.
std::string MethodsOf(bool takes_post);

// Turns a 200 into a 304 where the request's If-None-Match names its ETag.
Response Conditional(Response response, const Request& request);

// RFC 9110, section 13.1.2: a list of ETags, weakly compared, or "*".
bool MatchesEtag(std::string_view if_none_match, std::string_view etag);

// A strong ETag of bytes in one coding, with its quotes.
std::string MakeEtag(std::string_view bytes, Coding coding);

}  // namespace terrace::server

// GET requests over connections that are kept open.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fly/http/url.h"

namespace terrace::fly {

struct HttpOptions {
  int threads = 1;
  int clients = 1;  // each has connections of its own
  // Limit of connecting to a resolved host, for all its addresses together, and again of a request with its reply.
  double timeout_s = 30;
  // Names and values, in each request to `headers_origin`. A name replaces a header of the client; repeated names are
  // all sent. Other servers do not get them: a document may name tiles anywhere, and a header may be a secret.
  std::vector<std::pair<std::string, std::string>> headers;
  Origin headers_origin;
  bool verifies_certificates = true;
};

enum class Failure {
  kNone,       // a complete reply, with any status
  kConnect,    // no connection: refused, unknown host, another failure of TLS
  kUntrusted,  // the server's certificate is not trusted, or is that of another host
  kTimeout,    // no complete reply in time
  kCut,        // closed before the reply was complete
  kMalformed,  // not HTTP
  kTooLarge,
};

struct HttpReply {
  Failure failure = Failure::kNone;
  std::string detail;  // of a failure, for people
  int status = 0;
  std::string body;  // as it was sent; see `is_gzip`
  bool is_gzip = false;
  std::string server_timing, retry_after, date, cache_control, max_error;
  std::optional<Url> location;  // of a redirect that was not followed: 301, 302, 303, 307 or 308
  std::uint64_t bytes = 0;      // of heads and bodies
  double seconds = 0;           // from the call of Get to the last byte, connecting included
  bool opened_connection = false;
};

class HttpClient {
 public:
  explicit HttpClient(const HttpOptions& options);
  ~HttpClient();  // aborts open requests; no callback is called afterwards
  HttpClient(const HttpClient&) = delete;
  HttpClient& operator=(const HttpClient&) = delete;

  // Calls `done` on a thread of this object, exactly once unless this object is destroyed first. Any thread may call
  // this. Follows up to `max_redirects` redirects. Precondition: 0 <= client < options.clients.
  void Get(int client, Url url, std::string accept, int max_redirects, std::function<void(HttpReply)> done);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::fly

// Which web pages may read replies: the Access-Control-Allow-Origin and Timing-Allow-Origin of every reply.
#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace terrace::server {

// Immutable.
class CorsPolicy {
 public:
  // Any page.
  CorsPolicy() : CorsPolicy(std::vector<std::string>{"*"}) {}
  // "https://maps.example" and so on; "*" is any; none: no page of another origin.
  explicit CorsPolicy(const std::vector<std::string>& origins);

  // Header lines for a request from `origin`. They are the configuration's text: nothing of the request's is sent back.
  std::string_view HeadersFor(std::string_view origin) const;

  // Whether the reply depends on the request's Origin.
  bool varies() const { return !any_; }

 private:
  bool any_ = false;
  std::string any_headers_;
  std::unordered_map<std::string, std::string> headers_;  // by origin
};

}  // namespace terrace::server

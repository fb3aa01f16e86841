// Cross-origin rules: Access-Control-Allow-Origin and Timing-Allow-Origin of every reply.
#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace terrace::server {

// Immutable.
class CorsPolicy {
 public:
  // Allows every origin.
  CorsPolicy() : CorsPolicy(std::vector<std::string>{"*"}) {}
  // Allows these origins, such as "https://maps.example". "*" allows every origin; an empty list allows no other
  // origin.
  explicit CorsPolicy(const std::vector<std::string>& origins);

  // The header lines for a request from `origin`. Their text is that of the configuration, never that of the request.
  std::string_view HeadersFor(std::string_view origin) const;

  // Whether the reply depends on the request's Origin.
  bool varies() const { return !any_; }

 private:
  bool any_ = false;
  std::string any_headers_;
  std::unordered_map<std::string, std::string> headers_;  // by origin
};

}  // namespace terrace::server

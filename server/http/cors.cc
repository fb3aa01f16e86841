#include "server/http/cors.h"

#include <fmt/format.h>

namespace terrace::server {
namespace {

std::string HeadersOf(std::string_view origin) {
  return fmt::format(
      "Access-Control-Allow-Origin: {0}\r\n"
      "Access-Control-Expose-Headers: ETag, Terrain-Max-Error, Terrain-Certified-Error, Terrain-Origin, "
      "Terrain-Grid, Retry-After, Server-Timing\r\n"
      "Timing-Allow-Origin: {0}\r\n",
      origin);
}

}  // namespace

CorsPolicy::CorsPolicy(const std::vector<std::string>& origins) {
  for (const std::string& origin : origins) {
    if (origin == "*") any_ = true;
    headers_.emplace(origin, HeadersOf(origin));
  }
  if (any_) any_headers_ = HeadersOf("*");
}

std::string_view CorsPolicy::HeadersFor(std::string_view origin) const {
  if (any_) return any_headers_;
  const auto found = headers_.find(std::string(origin));
  return found == headers_.end() ? std::string_view() : found->second;
}

}  // namespace terrace::server

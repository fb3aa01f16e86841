// The texts of HTTP status codes.
#pragma once

#include <algorithm>
#include <iterator>
#include <string_view>

namespace terrace::server {

struct StatusText {
  int status;
  std::string_view phrase;  // of the status line
  std::string_view title;   // of application/problem+json
};

inline constexpr StatusText kStatusTexts[] = {
    {200, "OK", ""},
    {204, "No Content", ""},
    {304, "Not Modified", ""},
    {400, "Bad Request", "Bad request"},
    {401, "Unauthorized", "Unauthorized"},
    {403, "Forbidden", "Forbidden"},
    {404, "Not Found", "Not found"},
    {405, "Method Not Allowed", "Method not allowed"},
    {408, "Request Timeout", "Request timeout"},
    {413, "Content Too Large", "Content too large"},
    {414, "URI Too Long", "URI too long"},
    {415, "Unsupported Media Type", "Unsupported media type"},
    {429, "Too Many Requests", "Too many requests"},
    {431, "Request Header Fields Too Large", "Request header too large"},
    {503, "Service Unavailable", "Service unavailable"},
};

// The row of a status; that of 503 for any other number.
constexpr const StatusText& TextOfStatus(int status) {
  const StatusText* const row = std::ranges::find(kStatusTexts, status, &StatusText::status);
  return row == std::end(kStatusTexts) ? *std::prev(row) : *row;
}

}  // namespace terrace::server

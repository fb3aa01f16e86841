// Parses arbitrary bytes as the body of a POST for heights, in both content types.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/check.h"
#include "server/query/heights_query.h"
#include "tests/fuzz/fuzz_input.h"

namespace terrace::fuzz {
namespace {

constexpr std::size_t kMaxPoints = 100;

void Try(std::string_view content_type, std::string_view body) {
  TERRACE_CHECK(server::IsPointsBody(content_type));
  const auto query = server::ParseHeights({{}, content_type, body}, kMaxPoints);
  if (!query) {
    TERRACE_CHECK(query.error().code == ErrorCode::kInvalidArgument);
    // Messages contain no bytes of the request, only the server's words and numbers.
    for (const unsigned char c : query.error().message) TERRACE_CHECK(c >= 0x20 && c < 0x7f);
    return;
  }
  TERRACE_CHECK(!query->points.empty() && query->points.size() <= kMaxPoints);
  for (const auto& point : query->points) {
    TERRACE_CHECK(std::abs(point.longitude) <= 180 && std::abs(point.latitude) <= 90);
  }
  TERRACE_CHECK(query->distances_m.empty() || query->distances_m.size() == query->points.size());
  for (std::size_t i = 1; i < query->distances_m.size(); ++i) {
    TERRACE_CHECK(query->distances_m[i] >= query->distances_m[i - 1]);  // false for NaN as well
  }
}

}  // namespace
}  // namespace terrace::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view body(reinterpret_cast<const char*>(data), size);
  const bool json = body.starts_with('{') || body.starts_with('[');
  terrace::fuzz::Try(json ? "application/json; charset=utf-8" : "application/x-www-form-urlencoded", body);
  return 0;
}

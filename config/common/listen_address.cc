#include "config/common/listen_address.h"

#include <arpa/inet.h>
#include <sys/un.h>

#include <algorithm>
#include <optional>

#include "engine/core/parse_number.h"

namespace terrace::config {
namespace {

constexpr std::string_view kExamples = "HOST:PORT such as 127.0.0.1:8080, 0.0.0.0:8080 or [::1]:8080";

constexpr std::string_view kUnix = "unix:";
constexpr std::size_t kMaxPath = sizeof(sockaddr_un::sun_path) - 1;

bool IsIpAddress(int family, const std::string& host) {
  if (host.find('\0') != std::string::npos) return false;  // inet_pton would not read past it
  unsigned char bytes[sizeof(in6_addr)];
  return inet_pton(family, host.c_str(), bytes) == 1;
}

// RFC 1123 host names. One of digits and dots alone is a mistyped IPv4 address.
bool IsHostName(std::string_view host) {
  const auto is_allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '.';
  };
  const bool numeric = host.find_first_not_of("0123456789.") == std::string_view::npos;
  return !host.empty() && host.size() <= 253 && !numeric && host.front() != '-' && host.front() != '.' &&
         std::all_of(host.begin(), host.end(), is_allowed);
}

}  // namespace

Result<ListenAddress> ParseListenAddress(std::string_view text) {
  if (!text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "has no host; write 127.0.0.1:{} for this machine, 0.0.0.0:{} for every interface", text, text);
  }
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos || text.ends_with(']')) {
    return MakeError(ErrorCode::kInvalidArgument, "has no port; write {}", kExamples);
  }
  const std::optional<std::uint16_t> port = ParseNumber<std::uint16_t>(text.substr(colon + 1));
  std::string host(text.substr(0, colon));
  const bool bracketed = host.size() >= 2 && host.front() == '[' && host.back() == ']';
  if (bracketed) host = host.substr(1, host.size() - 2);
  if (!bracketed && host.find(':') != std::string::npos) {
    return MakeError(ErrorCode::kInvalidArgument, "an IPv6 address must stand in brackets, as in [::1]:8080");
  }
  if (!port) {
    return MakeError(ErrorCode::kInvalidArgument, "the port must be a number from 0 (any free port) to 65535");
  }
  const bool valid_host = bracketed ? IsIpAddress(AF_INET6, host) : IsIpAddress(AF_INET, host) || IsHostName(host);
  if (!valid_host) {
    return MakeError(ErrorCode::kInvalidArgument, "what stands before the port is not a host; write {}", kExamples);
  }
  return ListenAddress{std::move(host), *port};
}

Result<ListenAddress> ParseListenAddressOrPath(std::string_view text) {
  if (!text.starts_with(kUnix)) return ParseListenAddress(text);
  ListenAddress address;
  address.path = text.substr(kUnix.size());
  const bool is_path = address.path.size() > 1 && address.path.front() == '/' && address.path.back() != '/' &&
                       address.path.find('\0') == std::string::npos && address.path.size() <= kMaxPath;
  if (is_path) return address;
  return MakeError(
      ErrorCode::kInvalidArgument,
      "what follows unix: must be an absolute path of at most {} bytes, as in unix:/run/terrace/admin.sock", kMaxPath);
}

std::string ToString(const ListenAddress& address) {
  if (!address.path.empty()) return std::string(kUnix) + address.path;
  const bool is_ipv6 = address.host.find(':') != std::string::npos;
  return is_ipv6 ? fmt::format("[{}]:{}", address.host, address.port)
                 : fmt::format("{}:{}", address.host, address.port);
}

}  // namespace terrace::config

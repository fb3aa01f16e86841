// The address that the server listens on: "127.0.0.1:8080", "[::1]:8080", "localhost:0".
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::config {

struct ListenAddress {
  std::string host;        // IPv4, IPv6 without brackets, or a host name
  std::uint16_t port = 0;  // 0: any free port

  friend bool operator==(const ListenAddress&, const ListenAddress&) = default;
};

// kInvalidArgument: the message says what is wrong and how to correct it.
Result<ListenAddress> ParseListenAddress(std::string_view text);

// Formats an address for ParseListenAddress and for URLs: IPv6 in brackets.
std::string ToString(const ListenAddress& address);

}  // namespace terrace::config

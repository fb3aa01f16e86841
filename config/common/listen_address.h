// The address that the server listens on: "127.0.0.1:8080", "[::1]:8080", "localhost:0"; for operators also
// "unix:/run/terrace/admin.sock".
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::config {

struct ListenAddress {
  std::string host;        // IPv4, IPv6 without brackets, or a host name
  std::uint16_t port = 0;  // 0: any free port
  std::string path = {};   // of a Unix socket, absolute; then there is no host

  friend bool operator==(const ListenAddress&, const ListenAddress&) = default;
};

// kInvalidArgument: the message says what is wrong and how to correct it.
Result<ListenAddress> ParseListenAddress(std::string_view text);

// The same, or "unix:" and an absolute path of at most 107 bytes.
Result<ListenAddress> ParseListenAddressOrPath(std::string_view text);

// Formats an address for ParseListenAddress and for URLs: IPv6 in brackets.
std::string ToString(const ListenAddress& address);

}  // namespace terrace::config

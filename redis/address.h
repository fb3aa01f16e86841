// Where a Redis is: redis://[user[:password]@]HOST[:PORT][/DATABASE], with TLS rediss://.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "engine/core/result.h"

namespace terrace::redis {

struct Address {
  bool is_tls = false;
  std::string host;  // a name, an IPv4 address, or an IPv6 address without brackets
  std::uint16_t port = 6379;
  std::string user, password;  // empty: none
  int database = 0;

  // As a URL without user and password: for messages and logs.
  std::string Text() const;
};

// Percent codes in user and password are decoded. redis://:password@HOST has no user.
// kInvalidArgument: not such a URL; the message says what is wrong and has neither user nor password.
Result<Address> ParseAddress(std::string_view url);

}  // namespace terrace::redis

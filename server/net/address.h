// IP addresses of connections.
#pragma once

#include <boost/asio/ip/address.hpp>

#include "server/asio/asio.h"

namespace terrace::server {

// Converts IPv4-mapped IPv6 addresses (::ffff:192.0.2.1) to IPv4.
inline asio::ip::address Canonical(const asio::ip::address& any) {
  if (any.is_v6() && any.to_v6().is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, any.to_v6());
  return any;
}

}  // namespace terrace::server

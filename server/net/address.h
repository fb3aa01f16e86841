// IP addresses of connections.
#pragma once

#include <boost/asio/ip/address.hpp>

#include "server/asio.h"

namespace terrace::server {

// Converts IPv4-mapped IPv6 addresses (::ffff:192.0.2.1) to IPv4.
asio::ip::address Canonical(const asio::ip::address& address);

}  // namespace terrace::server

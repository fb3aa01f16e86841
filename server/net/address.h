// Addresses of connections' ends.
#pragma once

#include <boost/asio/ip/address.hpp>

#include "server/asio.h"

namespace terrace::server {

// IPv4 in its own form, also where it came as ::ffff:192.0.2.1.
asio::ip::address Canonical(const asio::ip::address& address);

}  // namespace terrace::server

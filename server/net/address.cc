#include "server/net/address.h"

#include <boost/asio/ip/address_v4.hpp>

namespace terrace::server {

asio::ip::address Canonical(const asio::ip::address& any) {
  if (any.is_v6() && any.to_v6().is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, any.to_v6());
  return any;
}

}  // namespace terrace::server

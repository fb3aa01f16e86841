// Who a request comes from, where proxies may stand between: addresses, ranges of them, and what proxies report.
#pragma once

#include <boost/asio/ip/address.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/asio.h"
#include "server/http/request.h"
#include "server/net/address.h"

namespace terrace::server {

// What counts as one client: an IPv4 address, or the 64 bits that an IPv6 network hands to one of its customers.
std::string ClientBlock(const asio::ip::address& address);

class AddressRanges {
 public:
  // "10.0.0.0/8", "2001:db8::/32", or single addresses. kInvalidArgument names the text that is neither.
  static Result<AddressRanges> Parse(const std::vector<std::string>& texts);

  bool Contains(const asio::ip::address& address) const;
  bool empty() const { return ranges_.empty(); }

 private:
  struct Range {
    asio::ip::address_v6::bytes_type bytes{};  // IPv4 as ::ffff:a.b.c.d
    unsigned bits = 0;
  };
  std::vector<Range> ranges_;
};

// The proxies that are believed, and how they say whom they speak for.
struct Proxies {
  AddressRanges trusted;
  config::ForwardedHeader header = config::ForwardedHeader::kXForwarded;
};

// Replaces the request's scheme and host by what a trusted proxy reports, and returns the client: the last address on
// the way here that is no trusted proxy. Nothing is believed of a peer that is not trusted. `peer`: the connection's
// other end.
asio::ip::address ResolveClient(Request& request, const asio::ip::address& peer, const Proxies& proxies);

}  // namespace terrace::server

// The address of a request's client, behind proxies: addresses, address ranges, and the headers that proxies send.
#pragma once

#include <boost/asio/ip/address.hpp>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/asio/asio.h"
#include "server/http/request.h"
#include "server/net/address.h"

namespace terrace::server {

// The block of addresses that counts as one client: an IPv4 address, or an IPv6 /64 network.
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

// The trusted proxies, and the headers in which they report the client.
struct Proxies {
  AddressRanges trusted;
  config::ForwardedHeader header = config::ForwardedHeader::kXForwarded;
};

// Replaces the request's scheme and host by those that a trusted proxy reports, and returns the client's address: the
// last one in the chain of proxies that is not a trusted proxy. Headers from a peer that is not trusted are ignored.
// `peer`: the remote address of the connection.
asio::ip::address ResolveClient(Request& request, const asio::ip::address& peer, const Proxies& proxies);

}  // namespace terrace::server

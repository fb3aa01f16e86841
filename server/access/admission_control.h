// Decides on a request before any work is done for it: who sent it, at which rate, and what it may see.
//
// Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "config/config.h"
#include "server/access/client_address.h"
#include "server/access/rate_limiter.h"
#include "server/api/request_context.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// Immutable. Tokens are stored and compared as hashes, so that the time of a comparison reveals nothing about a token.
class AccessPolicy {
 public:
  // Without tokens every dataset is public. With tokens only `public_datasets` are. Two tokens must not have the same
  // hash.
  static AccessPolicy Make(const std::vector<config::TokenConfig>& tokens,
                           const std::vector<std::string>& public_datasets);

  bool has_tokens() const { return !grants_.empty(); }

  // The grant of requests without a token.
  const GrantPtr& anonymous() const { return anonymous_; }

  // Returns null if the token is unknown.
  GrantPtr Find(std::string_view token) const;

 private:
  std::unordered_map<std::string, GrantPtr> grants_;  // by SHA-256
  GrantPtr anonymous_;
};

// Removes every `token` parameter from the query of `target` and returns its decoded value; nothing if there is none.
// Clients append the parameter each time they follow a link, so it may be repeated; if the values differ, the result is
// a token that does not exist. A percent-encoded name (%74oken) stays: RouteTable::Match refuses such a
// request, except of rows with takes_any_query, which ignore it.
std::optional<std::string> TakeToken(std::string& target);

// A client as it is logged and counted.
struct ClientIdentity {
  ClientIdentity() = default;
  explicit ClientIdentity(const asio::ip::address& a)
      : address(a), text(a.to_string()), counted_as(ClientBlock(a)), number(std::hash<std::string>{}(counted_as) | 1) {}

  asio::ip::address address;
  std::string text = "-";
  std::string counted_as;    // an IPv4 address or an IPv6 /64 (ClientBlock)
  std::uint64_t number = 1;  // hash of `counted_as`; never 0
};

struct AdmissionOptions {
  Proxies proxies;
  AccessPolicy access;
  RateLimiter::Rate rate;  // of each token without a rate of its own, and of each client without a token
};

class AdmissionControl {
 public:
  explicit AdmissionControl(AdmissionOptions options) : options_(std::move(options)) {}

  // Returns the client that sent the request, behind the proxies. Moves the token from the request's target to
  // `context`, with its grant. Sets the request's scheme, host, `is_private` and `client`. `peer`: the remote end of
  // the connection.
  ClientIdentity Identify(Request& request, const ClientIdentity& peer, RequestContext& context) const;

  // Takes a turn for a request: a client that exceeds its rate waits, at most `longest_wait`. All requests count,
  // including those with unknown URLs; probes do not.
  RateLimiter::Turn TakeTurn(const RequestContext& context, const ClientIdentity& client,
                             std::chrono::milliseconds longest_wait);
  // 429, for a request whose turn was not granted.
  static Response TooManyRequests(const RateLimiter::Turn& turn, const RequestContext& context);

  // 401 or 403; nothing if the request may continue.
  std::optional<Response> Refuse(const RequestContext& context) const;

  // Whether the reply depends on the request's token.
  bool DependsOnToken(const RequestContext& context) const;

  const Proxies& proxies() const { return options_.proxies; }

 private:
  const AdmissionOptions options_;
  RateLimiter limiter_;
};

}  // namespace terrace::server

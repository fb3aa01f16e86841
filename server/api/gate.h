// Decides on a request before any work is done for it: who sent it, at which rate, and what it may see.
//
// Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/api/access.h"
#include "server/api/call.h"
#include "server/api/client_address.h"
#include "server/api/rate_limiter.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// A client as it is logged and counted.
struct Caller {
  Caller() = default;
  explicit Caller(const asio::ip::address& a)
      : address(a), text(a.to_string()), block(ClientBlock(a)), number(std::hash<std::string>{}(block) | 1) {}

  asio::ip::address address;
  std::string text = "-", block;
  std::uint64_t number = 1;  // of the block; never 0
};

struct GateOptions {
  Proxies proxies;
  AccessPolicy access;
  RateLimiter::Rate rate;  // of each token, and of each client without one
};

class Gate {
 public:
  explicit Gate(GateOptions options) : options_(std::move(options)) {}

  // Returns the client that sent the request, behind the proxies. Moves the token from the request's target to `call`,
  // with its grant. Sets the request's scheme, host, `is_private` and `client`. `peer`: the remote end of the
  // connection.
  Caller Identify(Request& request, const Caller& peer, Call& call) const;

  // When the request may continue, at most after `longest_wait`: clients that exceed their rate wait. All requests
  // count but probes, also those with unknown URLs.
  RateLimiter::Turn TakeTurn(const Call& call, const Caller& caller, std::chrono::milliseconds longest_wait);
  // 429, for a request whose turn was not granted.
  static Response TooManyRequests(const RateLimiter::Turn& turn, const Call& call);

  // 401 or 403; nothing if the request may continue.
  std::optional<Response> Refuse(const Call& call) const;

  // Whether the reply depends on the request's token.
  bool IsForGrant(const Call& call) const;

  const Proxies& proxies() const { return options_.proxies; }

 private:
  const GateOptions options_;
  RateLimiter limiter_;
};

}  // namespace terrace::server

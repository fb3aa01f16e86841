// What is decided about a request before anything is done for it: who asks, how often, and what they may see.
//
// Thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/http/access.h"
#include "server/http/client_address.h"
#include "server/http/rate_limiter.h"
#include "server/http/request.h"
#include "server/http/response.h"
#include "server/http/router.h"

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

  // Who sent the request, behind the proxies; sets the request's scheme, host and grant. `peer`: the connection's other
  // end.
  Caller Identify(Request& request, const Caller& peer) const;

  // What counts as one client, among those who share the server: a token's name behind a slash, or the block of the
  // address.
  static std::string Who(const Request& request, const Caller& caller);
  // The same in short; never 0.
  static std::uint64_t NumberOf(const Request& request, const Caller& caller);

  // When the request may go on, at most after `longest_wait`: clients that ask too often wait. All but probes count,
  // those to URLs that do not exist among them.
  RateLimiter::Turn TakeTurn(const Request& request, const Result<Route>& route, const Caller& caller,
                             std::chrono::milliseconds longest_wait);
  // 429, to whom no turn was granted.
  static Response TooManyRequests(const RateLimiter::Turn& turn, const Request& request, const Result<Route>& route);

  // 401 or 403; nothing where the request may go on.
  std::optional<Response> Refuse(const Request& request, const Route& route) const;

  // Marks a reply that another token would not get.
  void Mark(const Request& request, const Route& route, Response& response) const;

  const Proxies& proxies() const { return options_.proxies; }

 private:
  const GateOptions options_;
  RateLimiter limiter_;
};

}  // namespace terrace::server

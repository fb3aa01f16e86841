// The program behind the HTTP side, as sessions and the listener see it. They know nothing else of it.
#pragma once

#include <boost/asio/ip/address.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "server/asio.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// What is decided from a request's head alone.
struct Admission {
  std::chrono::milliseconds wait{0};     // before the request goes on, or before the next one would
  std::optional<Response> refusal = {};  // sent in place of an answer; a body that follows is not read
  bool delays_refusal = false;           // its client asks too often, and would ask again at once
  std::size_t max_body_bytes = 0;        // of a POST that is taken
  bool for_grant = false;                // another token, or none, would be answered otherwise
};

// A reply, or what has to be awaited for one.
using Answer = std::variant<Response, asio::awaitable<Response>>;

// Of a reply whose last byte was handed to the kernel. Valid during the call only.
struct SentReply {
  const Request& request;
  const Response& response;
  std::size_t body_bytes = 0;
  std::chrono::microseconds duration{0};  // from the end of the request's head
  std::string_view peer;                  // address and port
  bool is_admitted = false;               // false: what came was no request, and nobody was asked about it
};

// Serves the requests of one connection, one after the other, on the connection's thread.
class ConnectionHandler {
 public:
  virtual ~ConnectionHandler() = default;

  // The request's head has arrived, its body has not. Sets `client` and `is_private`, replaces the host and scheme by
  // what a trusted proxy says, and takes secrets out of the target. `longest_wait`: of Admission::wait.
  virtual Admission Admit(Request& request, std::chrono::milliseconds longest_wait) = 0;

  // Answers the request that was admitted last, whose body has arrived. Called again where the reply had to be let go
  // before it could be sent. This and `request` outlive the answer. What is awaited runs on the connection's thread,
  // and is cancelled when the client leaves. Both may throw exceptions of the standard library.
  virtual Answer Handle(const Request& request) = 0;

  virtual void Report(const SentReply& reply) = 0;
};

// Thread-safe. Outlives all connections.
class Application {
 public:
  virtual ~Application() = default;

  // `peer`: the connection's other end.
  virtual std::unique_ptr<ConnectionHandler> Connect(const asio::ip::address& peer) = 0;

  // The client that a connection counts for; empty: nobody.
  virtual std::string ClientOf(const asio::ip::address& peer) const = 0;
};

}  // namespace terrace::server

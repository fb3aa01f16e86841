// The interface between HTTP and the program that answers requests. Sessions and the listener use nothing else of it.
#pragma once

#include <boost/asio/ip/address.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "server/asio/asio.h"
#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

// The decision made from a request's head alone.
struct Admission {
  // Delay before the request continues, or before `refusal` is sent. Not used with `delays_refusal`.
  std::chrono::milliseconds wait{0};
  std::optional<Response> refusal = {};  // sent instead of an answer; the request's body is not read
  bool delays_refusal = false;           // the client exceeds its rate; an immediate refusal would be retried at once
  std::size_t max_body_bytes = 0;        // limit of a POST's body
  std::string_view body_remedy = {};     // for larger bodies, as the end of a message
  bool depends_on_token = false;         // the reply depends on the request's token
};

// A reply, or a coroutine that makes one.
using Answer = std::variant<Response, asio::awaitable<Response>>;

// A reply that was sent, or one with status 499 if the client left before there was a reply. Its references are valid
// during ConnectionHandler::Report.
struct SentReply {
  const Request& request;
  const Response& response;
  std::size_t body_bytes = 0;
  std::chrono::microseconds duration{0};  // from the end of the request's head
  std::string_view peer;                  // address and port
  bool has_valid_head = false;            // false: the bytes were not a valid request, and Admit was not called
};

// Serves the requests of one connection, one after the other, on the connection's thread.
class ConnectionHandler {
 public:
  virtual ~ConnectionHandler() = default;

  // Called when the request's head has arrived, before its body. Sets `client` and `is_private`, replaces host and
  // scheme by those that a trusted proxy reports, and removes secrets from the target. `longest_wait`: limit of
  // Admission::wait.
  virtual Admission Admit(Request& request, std::chrono::milliseconds longest_wait) = 0;

  // Answers the last admitted request, whose body has arrived. Called again if the reply had to be released before it
  // could be sent. This object and `request` outlive the answer. A coroutine runs on the connection's thread, and is
  // cancelled when the client leaves. Handle and the coroutine may throw exceptions of the standard library.
  virtual Answer Handle(const Request& request) = 0;

  virtual void Report(const SentReply& reply) = 0;
};

// Thread-safe. Outlives all connections.
class Application {
 public:
  virtual ~Application() = default;

  // `peer`: the connection's other end.
  virtual std::unique_ptr<ConnectionHandler> Connect(const asio::ip::address& peer) = 0;

  // The client whose limit a connection counts against; empty: none.
  virtual std::string ClientOf(const asio::ip::address& peer) const = 0;
};

}  // namespace terrace::server

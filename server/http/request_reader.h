// Requests out of a stream's bytes: one head after the other, and the bodies of those that have one.
//
// For one thread. Holds one buffer of at most kMaxHeadBytes, and what has arrived of a body.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "server/asio.h"
#include "server/http/request.h"
#include "server/http/stream.h"

namespace terrace::server {

struct ReadTimeouts {
  std::chrono::milliseconds message{5'000};  // from a request's first byte to its empty line; again for its body
  std::chrono::milliseconds idle{30'000};    // between a reply and the next request
};

class RequestReader {
 public:
  RequestReader(Stream& stream, ReadTimeouts timeouts);

  // Nothing: the connection ended, was idle for too long, or is closing and no request has begun.
  using Head = std::optional<tl::expected<Request, BadRequest>>;
  asio::awaitable<Head> ReadHead();

  // Reads as many bytes as the request promises; memory is taken as they arrive. What went wrong: `status` 0 says that
  // the client left.
  asio::awaitable<tl::expected<void, BadRequest>> ReadBody(Request& request);

  // No further request is waited for; one that has begun is read.
  void Close();
  bool closing() const { return closing_; }
  bool waiting() const { return waiting_; }  // for the first byte of a request

  // Forgets what was read, then reads and forgets on, until the client ends or `most` bytes have come.
  asio::awaitable<void> Discard(std::size_t most);

 private:
  std::string_view Unread() const { return std::string_view(buffer_).substr(consumed_); }
  void Consume(std::size_t bytes) { consumed_ += bytes; }
  asio::awaitable<Transfer> Fill(std::size_t room);
  bool FillWithWhatArrived();

  Stream& stream_;
  const ReadTimeouts timeouts_;
  std::string buffer_;  // what was read; beyond `consumed_`, the next requests of a client that does not wait
  std::size_t consumed_ = 0;
  HeadMemo memo_;
  bool is_first_ = true;
  bool waiting_ = false;
  bool closing_ = false;
};

}  // namespace terrace::server

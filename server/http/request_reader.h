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
#include "server/net/stream.h"

namespace terrace::server {

struct ReadTimeouts {
  std::chrono::milliseconds message{5'000};  // from a request's first byte to its empty line; of a body, without a
                                             // single byte, and before min_rate counts
  std::chrono::milliseconds idle{30'000};    // between a reply and the next request
  std::size_t min_rate = 4096;               // bytes a second of a body in the long run; 0: any
};

class RequestReader {
 public:
  RequestReader(Stream& stream, ReadTimeouts timeouts);

  // Nothing: the connection ended, was idle for too long, or is closing and no request came in time. `now`: the
  // present, or shortly before.
  using Head = std::optional<tl::expected<void, BadRequest>>;
  asio::awaitable<Head> ReadHead(Request& request, Stream::Clock::time_point now);

  // Reads the request's body until `text`, which has its beginning, has `size` bytes of it. What went wrong: `status` 0
  // says that the client left, or that the stream was cancelled.
  asio::awaitable<tl::expected<void, BadRequest>> ReadBody(const Request& request, std::string& text, std::size_t size);

  // The next request is the last one, and is waited for only until `grace` has passed from now; one that has begun by
  // then is read.
  void Close(std::chrono::milliseconds grace = std::chrono::milliseconds(0));
  bool has_unread() const { return begin_ < end_; }  // of a further request, or of its beginning
  bool closing() const { return closing_; }
  bool waiting() const { return waiting_; }  // for the first byte of a request

  // Forgets what was read, then reads and forgets on, until the client ends or `most` bytes have come.
  asio::awaitable<void> Discard(std::size_t most);

 private:
  std::string_view Unread() const { return std::string_view(buffer_).substr(begin_, end_ - begin_); }
  void Consume(std::size_t bytes) { begin_ += bytes; }
  asio::mutable_buffer Room(std::size_t bytes);
  asio::awaitable<Transfer> Fill(std::size_t room);
  bool FillWithWhatArrived();

  Stream& stream_;
  const ReadTimeouts timeouts_;
  std::string buffer_;  // grows, and is not cleared: filling it with zeros takes as long as parsing
  std::size_t begin_ = 0,
              end_ = 0;  // of what was read and not consumed: the next requests of a client that does not wait
  HeadMemo memo_;
  bool is_first_ = true;
  bool waiting_ = false;
  bool closing_ = false;
  Stream::Clock::time_point close_at_ = Stream::Clock::time_point::max();  // unless a request has begun
};

}  // namespace terrace::server

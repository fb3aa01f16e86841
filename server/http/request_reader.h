// Reads requests from a stream: heads one after the other, and bodies.
//
// For use on one thread. Memory: one buffer of at most kMaxHeadBytes, and the part of a body that has arrived.
#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "server/asio/asio.h"
#include "server/http/request.h"
#include "server/net/stream.h"

namespace terrace::server {

struct ReadTimeouts {
  // For a head, from its first byte to its empty line; also for the first byte of a new connection. For a body, the
  // longest time between two bytes, and the time before min_rate applies.
  std::chrono::milliseconds message{5'000};
  std::chrono::milliseconds idle{30'000};  // between a reply and the next request
  std::size_t min_rate = 4096;             // average bytes per second of a body; 0: any
};

class RequestReader {
 public:
  RequestReader(Stream& stream, ReadTimeouts timeouts);

  // Returns nothing if the connection has ended, was idle for too long, or no request had begun by the `close_at` of
  // EndSoon. `now`: the current time, or shortly before.
  using HeadOutcome = std::optional<tl::expected<void, BadRequest>>;
  asio::awaitable<HeadOutcome> ReadHead(Request& request, Stream::Clock::time_point now);

  // Reads the request's body until `text`, which holds its beginning, has `size` bytes. On errors, `status` 0 means
  // that the client left or the stream was cancelled.
  asio::awaitable<tl::expected<void, BadRequest>> ReadBody(const Request& request, std::string& text, std::size_t size);

  // Ends the connection after the request that is being served. If none is being served, or the head of its reply has
  // promised to keep the connection, the client may send another one: the reader waits until `close_at` for its first
  // byte, and then reads it.
  void EndSoon(Stream::Clock::time_point close_at = Stream::Clock::now());
  bool has_unread() const { return begin_ < end_; }  // a further request, or part of one
  bool is_ending() const { return is_ending_; }
  bool waiting() const { return waiting_; }  // for the first byte of a request

  // Discards what was read, then reads and discards until the client ends its sending or `max_bytes` bytes have come.
  asio::awaitable<void> Discard(std::size_t max_bytes);

 private:
  std::string_view Unread() const { return std::string_view(buffer_).substr(begin_, end_ - begin_); }
  void Consume(std::size_t bytes) { begin_ += bytes; }
  asio::mutable_buffer Room(std::size_t bytes);
  asio::awaitable<Transfer> Fill(std::size_t room);
  bool FillWithWhatArrived();

  Stream& stream_;
  const ReadTimeouts timeouts_;
  std::string buffer_;  // never shrinks: growing it again would fill it with zeros, which takes as long as parsing
  // The bytes of buffer_ that were read and not consumed: pipelined requests.
  std::size_t begin_ = 0, end_ = 0;
  HeadMemo memo_;
  bool is_first_ = true;
  bool waiting_ = false;
  bool is_ending_ = false;
  Stream::Clock::time_point close_at_ = Stream::Clock::time_point::max();  // unless a request has begun
};

}  // namespace terrace::server

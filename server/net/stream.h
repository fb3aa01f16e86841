// A connection's byte stream: a socket, or TLS over one, with a deadline for its operations.
//
// For use on one thread. Operations fail with an error of the system or of TLS; end of file is an error too.
#pragma once

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/system/error_code.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string_view>
#include <tl/expected.hpp>

#include "server/asio/asio.h"

namespace boost::asio::ssl {
class context;
}

namespace terrace::server {

using Transfer = tl::expected<std::size_t, boost::system::error_code>;  // bytes
using BufferPair = std::array<asio::const_buffer, 2>;

// Removes the first `bytes` from `buffers`.
void Skip(std::size_t bytes, BufferPair& buffers);

class Stream {
 public:
  using Clock = std::chrono::steady_clock;

  // `tls` null: plain.
  Stream(asio::ip::tcp::socket socket, std::shared_ptr<asio::ssl::context> tls);
  ~Stream();
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  asio::ip::tcp::socket& socket();
  bool is_tls() const;

  // Sets the deadline, until the next call: after it, the current operation and every later one fail.
  void ExpiresAfter(std::chrono::milliseconds time);
  void ExpiresAt(Clock::time_point deadline);
  void ExpiresNever();
  Clock::time_point deadline() const;
  bool expired() const;

  // The TLS handshake; does nothing on a plain stream.
  asio::awaitable<Transfer> Handshake();
  // At least one byte.
  asio::awaitable<Transfer> ReadSome(asio::mutable_buffer buffer);
  asio::awaitable<Transfer> WriteSome(BufferPair buffers);
  // Reads without waiting. Returns 0 bytes if none have arrived, and always for TLS.
  Transfer ReadReady(asio::mutable_buffer buffer);

  // Writes without waiting. Returns 0 bytes if none can be sent, and always for TLS.
  Transfer WriteReady(BufferPair buffers);

  // Sends `bytes`, the beginning of the next message, ahead of it; once for each message. A peer that has closed the
  // connection answers with a reset. A peer that has closed only its sending direction (RFC 9293, section 3.6) accepts
  // them. Does nothing for TLS.
  void SendAhead(std::string_view bytes);
  // The number of bytes of the next message that were sent ahead; 0 from then on.
  std::size_t TakeBytesSentAhead();

  // Cancels the current operation.
  void Cancel();
  // Closes the sending direction.
  asio::awaitable<void> FinishWriting();
  void Close();
  // Closes with a reset: the kernel drops bytes that were not sent yet.
  void Reset();

 private:
  struct State;
  const std::shared_ptr<State> state_;  // a deadline that passes in this moment may outlive the stream
};

}  // namespace terrace::server

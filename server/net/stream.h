// The two ends of a connection's bytes: a socket, or TLS on top of one; with a deadline for whatever is under way.
//
// For one thread. Operations end in an error of the system or of TLS; end of file is one.
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

#include "server/asio.h"

namespace boost::asio::ssl {
class context;
}

namespace terrace::server {

using Transfer = tl::expected<std::size_t, boost::system::error_code>;  // bytes
using BufferPair = std::array<asio::const_buffer, 2>;

// Takes `bytes` off the front of what is to be sent.
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

  // The operation under way when `time` has passed, and every one begun later, fails. Until the next call of this.
  void ExpiresAfter(std::chrono::milliseconds time);
  void ExpiresAt(Clock::time_point deadline);
  void ExpiresNever();
  Clock::time_point deadline() const;
  bool expired() const;

  // Of TLS; nothing to do for others.
  asio::awaitable<Transfer> Handshake();
  // At least one byte.
  asio::awaitable<Transfer> ReadSome(asio::mutable_buffer buffer);
  asio::awaitable<Transfer> WriteSome(BufferPair buffers);
  // What is there already, without waiting; 0 bytes if nothing, and always for TLS.
  Transfer ReadReady(asio::mutable_buffer buffer);

  // What can be sent without waiting; 0 bytes if nothing, and always for TLS.
  Transfer WriteReady(BufferPair buffers);

  // Sends `bytes`, with which the next message will begin, ahead of it, once for each message. A peer that has closed
  // the connection altogether answers with a reset; one that has closed its own direction alone (RFC 9293, section 3.6)
  // takes them. Does nothing for TLS.
  void SendAhead(std::string_view bytes);
  // How many bytes of the message that begins now were sent ahead.
  std::size_t TakeAhead();

  // Ends the operation under way.
  void Cancel();
  // Says that nothing more will be sent.
  asio::awaitable<void> FinishWriting();
  void Close();
  // Closes, and the kernel forgets what the client has not taken yet.
  void Reset();

 private:
  struct State;
  const std::shared_ptr<State> state_;  // a deadline that passes in this moment may outlive the stream
};

}  // namespace terrace::server

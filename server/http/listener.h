// The listening socket: accepts connections while there is room for them.
//
// At the cap, a newcomer takes the place of another connection (ConnectionSet::EvictOne), or is told 503 and closed: a
// client that waits in the kernel's queue does not know whether to try elsewhere. Running out of file descriptors is
// treated the same way, with one that is kept for that purpose.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/http/session.h"
#include "server/net/io_threads.h"

namespace terrace::server {

class Listener : public std::enable_shared_from_this<Listener> {
 public:
  // `host`: an address or a name. `port` 0: any that is free. Errors name the address and the remedy.
  static Result<std::shared_ptr<Listener>> Open(IoThreads& io, const std::string& host, std::uint16_t port,
                                                std::shared_ptr<const SessionContext> context);

  // On a TCP socket that listens already and that somebody else goes on holding: who is not accepted here waits for the
  // next process. Takes over the descriptor.
  static Result<std::shared_ptr<Listener>> Adopt(IoThreads& io, int socket,
                                                 std::shared_ptr<const SessionContext> context);

  // Whether Open could have the address now. It is not listened on meanwhile: nobody can connect.
  static Result<void> TryAddress(const std::string& host, std::uint16_t port);

  const std::string& host() const { return host_; }  // an adopted socket's address
  std::uint16_t port() const { return port_; }

  // Begins to accept, unless Close came first. Call once.
  void Start();

  // Accepts what already waits in the kernel's queue, unless somebody else holds the socket, then closes. Blocks until
  // that is done and every accepted connection has its session: not from an io thread. Call once.
  void Close();

 private:
  Listener(IoThreads& io, std::shared_ptr<const SessionContext> context);
  class Resume;

  void Spawn();
  static asio::awaitable<void> Run(std::shared_ptr<Listener> self);
  asio::awaitable<void> AcceptAll();
  asio::awaitable<void> Pause(std::chrono::milliseconds time);
  std::string ClientOf(const asio::ip::address& peer) const;
  asio::awaitable<void> Admit(asio::ip::tcp::socket socket);
  void RejectPending();
  void Refuse(asio::ip::tcp::socket& socket, int status);
  void TakeQueue();
  void Finish();

  IoThreads& io_;
  const std::shared_ptr<const SessionContext> context_;
  asio::ip::tcp::acceptor acceptor_;
  bool is_adopted_ = false;
  std::string host_;
  std::uint16_t port_ = 0;
  bool started_ = false, closing_ = false;  // for the acceptor's thread
  std::promise<void> closed_;
  std::optional<asio::posix::stream_descriptor> spare_;  // given up for a moment when there are no descriptors left
  bool crowded_ = false;
};

}  // namespace terrace::server

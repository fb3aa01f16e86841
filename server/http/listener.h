// The listening socket: accepts connections while there is room for them.
//
// At the cap it stops accepting, so that further clients wait in the kernel's queue, and asks connections that are only
// kept alive to go. Running out of file descriptors is treated the same way.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <cstdint>
#include <memory>
#include <string>

#include "engine/core/result.h"
#include "server/asio.h"
#include "server/http/io_threads.h"
#include "server/http/session.h"

namespace terrace::server {

class Listener : public std::enable_shared_from_this<Listener> {
 public:
  // `host`: an address or a name. `port` 0: any that is free. Errors name the address and the remedy.
  static Result<std::shared_ptr<Listener>> Open(IoThreads& io, const std::string& host, std::uint16_t port,
                                                std::shared_ptr<const SessionContext> context);

  std::uint16_t port() const { return port_; }

  // Begins to accept. Call once.
  void Start();

  // Accepts what already waits in the kernel's queue, then closes. Blocks until that is done: not from an io thread.
  void Close();

 private:
  Listener(IoThreads& io, std::shared_ptr<const SessionContext> context);
  static asio::awaitable<void> Run(std::shared_ptr<Listener> self);
  asio::awaitable<void> AcceptAll();
  void CloseOnItsThread();

  IoThreads& io_;
  const std::shared_ptr<const SessionContext> context_;
  asio::ip::tcp::acceptor acceptor_;
  std::uint16_t port_ = 0;
};

}  // namespace terrace::server

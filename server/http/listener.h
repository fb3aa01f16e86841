// The listening socket: accepts connections up to a limit.
//
// At the limit, a new connection takes the place of another one (ConnectionSet::EvictOne), or is answered 503 and
// closed. A client in the kernel's queue could not know that it should try elsewhere. A shortage of file descriptors is
// handled in the same way, with a spare descriptor that is kept for this purpose.
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
#include "server/asio/asio.h"
#include "server/http/session.h"
#include "server/http/unix_socket.h"
#include "server/net/io_threads.h"

namespace terrace::server {

class Listener : public std::enable_shared_from_this<Listener> {
 public:
  // `host`: an address or a name. `port` 0: any that is free. Errors name the address and the remedy.
  static Result<std::shared_ptr<Listener>> Open(IoThreads& io, const std::string& host, std::uint16_t port,
                                                std::shared_ptr<const SessionContext> context);

  // Uses a TCP socket that is listening already and that another holder keeps open: connections that are not accepted
  // here wait for the next process. Takes ownership of the descriptor.
  static Result<std::shared_ptr<Listener>> Adopt(IoThreads& io, int socket,
                                                 std::shared_ptr<const SessionContext> context);

  // Listens on a path of the file system, which is removed when the listener is closed. Errors: as ListenOnPath.
  static Result<std::shared_ptr<Listener>> OpenPath(IoThreads& io, const std::string& path, unsigned mode,
                                                    std::shared_ptr<const SessionContext> context);

  // Whether Open could use the address now. The socket does not listen: nobody can connect meanwhile.
  static Result<void> CheckAddress(const std::string& host, std::uint16_t port);

  const std::string& host() const { return host_; }  // of an adopted socket: its address
  std::uint16_t port() const { return port_; }
  bool is_path() const { return !file_.path().empty(); }
  const std::string& path() const { return file_.path(); }

  // Begins to accept connections, unless Close was called before. Call once.
  void Start();

  // Accepts the connections that wait in the kernel's queue, unless the socket has another holder, then closes. Blocks
  // until this is done and every accepted connection has its session: do not call it on an io thread. Call once.
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
  SocketFile file_;                         // of a Unix socket
  bool started_ = false, closing_ = false;  // for the acceptor's thread
  std::promise<void> closed_;
  std::optional<asio::posix::stream_descriptor> spare_;  // released briefly when no descriptors are left
  bool has_warned_ = false;  // of refused connections, since one was last accepted without replacing another
};

}  // namespace terrace::server

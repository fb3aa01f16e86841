#include "server/http/client_watch.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>

namespace terrace::server {
namespace {

// A request that takes longer than this is worth asking whether its client is still there.
constexpr std::chrono::milliseconds kPatience{100};
// Where bytes that nobody reads yet, another request or the end of what the client sends, hide whether the connection
// stands, the kernel is asked so often.
constexpr std::chrono::milliseconds kInterval{250};

// A client that has only ended its own sending (FIN: CLOSE_WAIT here) may still read the reply; RFC 9293, section 3.6.
// One that closed altogether looks the same until bytes are sent to it, and its tile is built and cached in vain.
bool IsOpen(asio::ip::tcp::socket& socket) {
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(socket.native_handle(), IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return false;
  return info.tcpi_state == TCP_ESTABLISHED || info.tcpi_state == TCP_CLOSE_WAIT;
}

}  // namespace

asio::awaitable<void> ClientLeft(Stream& stream) {
  asio::ip::tcp::socket& socket = stream.socket();
  asio::steady_timer timer(co_await asio::this_coro::executor, kPatience);
  co_await timer.async_wait(asio::use_awaitable);
  co_await socket.async_wait(asio::ip::tcp::socket::wait_read, asio::use_awaitable);
  while (IsOpen(socket)) {
    timer.expires_after(kInterval);
    co_await timer.async_wait(asio::use_awaitable);
  }
}

}  // namespace terrace::server

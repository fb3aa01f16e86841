#include "server/net/client_watch.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>
#include <string_view>

namespace terrace::server {
namespace {

// Time after which it is worth checking whether the client of a request is still there.
constexpr std::chrono::milliseconds kPatience{100};
// Interval of asking the kernel, if unread bytes (another request, or the end of the client's sending) hide the state
// of the connection.
constexpr std::chrono::milliseconds kInterval{250};

// The beginning of every reply; RFC 9112, section 4.
constexpr std::string_view kReplyBegin = "HTTP/1.";

bool IsUnix(int descriptor) {
  int domain = 0;
  socklen_t size = sizeof domain;
  return ::getsockopt(descriptor, SOL_SOCKET, SO_DOMAIN, &domain, &size) == 0 && domain == AF_UNIX;
}

// In the states of a TCP connection.
int StateOfUnix(int descriptor) {
  pollfd state{descriptor, POLLRDHUP, 0};
  if (::poll(&state, 1, 0) < 0 || (state.revents & (POLLHUP | POLLERR)) != 0) return TCP_CLOSE;
  return (state.revents & POLLRDHUP) != 0 ? TCP_CLOSE_WAIT : TCP_ESTABLISHED;
}

// The kernel's state: TCP_ESTABLISHED, TCP_CLOSE_WAIT once the client has closed its sending direction, ...
int StateOf(asio::ip::tcp::socket& socket) {
  if (IsUnix(socket.native_handle())) return StateOfUnix(socket.native_handle());
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(socket.native_handle(), IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return TCP_CLOSE;
  return info.tcpi_state;
}

bool IsOpen(Stream& stream) {
  const int state = StateOf(stream.socket());
  if (state == TCP_CLOSE_WAIT && !stream.is_tls()) {
    stream.SendAhead(kReplyBegin);
    return true;
  }
  return state == TCP_ESTABLISHED;
}

}  // namespace

asio::awaitable<void> ClientLeft(Stream& stream) {
  // Most calls are cancelled while they wait, and an exception would take some microseconds each time. A call that is
  // cancelled before it waits throws.
  boost::system::error_code ended;  // cancelled; or the socket was closed here, so the client is gone
  const auto awaitable = [&] { return asio::redirect_error(asio::use_awaitable, ended); };
  asio::steady_timer timer(co_await asio::this_coro::executor, kPatience);
  co_await timer.async_wait(awaitable());
  if (!ended) co_await stream.socket().async_wait(asio::ip::tcp::socket::wait_read, awaitable());
  while (!ended && IsOpen(stream)) {
    timer.expires_after(kInterval);
    co_await timer.async_wait(awaitable());
  }
}

}  // namespace terrace::server

#include "server/net/stream.h"

#include <netinet/tcp.h>

#include <algorithm>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <optional>
#include <utility>

namespace terrace::server {
namespace {

using asio::ip::tcp;
using boost::system::error_code;
using Clock = Stream::Clock;
using NotSentLowWater = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_NOTSENT_LOWAT>;

// Limit of the kernel's send buffer. The kernel's default grows to megabytes for each slow client.
constexpr int kUnsentBytes = 128 * 1024;

}  // namespace

void Skip(std::size_t bytes, BufferPair& buffers) {
  const std::size_t of_first = std::min(bytes, buffers[0].size());
  buffers[0] += of_first;
  buffers[1] += bytes - of_first;
}

struct Stream::State : std::enable_shared_from_this<State> {
  State(tcp::socket s, std::shared_ptr<asio::ssl::context> t)
      : socket(std::move(s)), timer(socket.get_executor()), context(std::move(t)) {
    if (context) tls.emplace(socket, *context);
  }

  // The timer is only changed if it would expire too late: a busy connection rarely changes it.
  void Watch() {
    if (watching && timer.expiry() <= deadline) return;
    watching = true;
    timer.expires_at(deadline);
    timer.async_wait([weak = weak_from_this()](const error_code& error) {
      const std::shared_ptr<State> state = weak.lock();
      if (!state || error) return;
      state->watching = false;
      state->Look();
    });
  }

  void Look() {
    if (!socket.is_open()) return;
    if (deadline == Clock::time_point::max()) return;
    if (Clock::now() < deadline) return Watch();
    expired = true;
    error_code ignored;
    socket.cancel(ignored);
  }

  tcp::socket socket;
  asio::steady_timer timer;
  const std::shared_ptr<asio::ssl::context> context;
  std::optional<asio::ssl::stream<tcp::socket&>> tls;
  Clock::time_point deadline = Clock::time_point::max();
  std::size_t ahead = 0;  // bytes of the next message that were sent
  bool watching = false;
  bool expired = false;
};

Stream::Stream(tcp::socket socket, std::shared_ptr<asio::ssl::context> tls)
    : state_(std::make_shared<State>(std::move(socket), std::move(tls))) {
  error_code ignored;
  state_->socket.set_option(tcp::no_delay(true), ignored);
  state_->socket.non_blocking(true, ignored);
  state_->socket.set_option(NotSentLowWater(kUnsentBytes), ignored);
}

Stream::~Stream() = default;

tcp::socket& Stream::socket() { return state_->socket; }
bool Stream::is_tls() const { return state_->tls.has_value(); }

void Stream::ExpiresAfter(std::chrono::milliseconds time) { ExpiresAt(Clock::now() + time); }

void Stream::ExpiresAt(Clock::time_point deadline) {
  state_->deadline = deadline;
  state_->expired = false;
  state_->Watch();
}

void Stream::ExpiresNever() {
  state_->deadline = Clock::time_point::max();
  state_->expired = false;
}

Clock::time_point Stream::deadline() const { return state_->deadline; }

bool Stream::expired() const { return state_->expired; }

asio::awaitable<Transfer> Stream::Handshake() {
  if (!state_->tls) co_return std::size_t{0};
  error_code error;
  co_await state_->tls->async_handshake(asio::ssl::stream_base::server,
                                        asio::redirect_error(asio::use_awaitable, error));
  if (error) co_return tl::unexpected(error);
  co_return std::size_t{0};
}

asio::awaitable<Transfer> Stream::ReadSome(asio::mutable_buffer buffer) {
  error_code error;
  if (state_->expired) co_return tl::unexpected(error_code(asio::error::operation_aborted));
  std::size_t got = 0;
  if (state_->tls) {
    got = co_await state_->tls->async_read_some(buffer, asio::redirect_error(asio::use_awaitable, error));
  } else {
    got = co_await state_->socket.async_read_some(buffer, asio::redirect_error(asio::use_awaitable, error));
  }
  if (error && got == 0) co_return tl::unexpected(error);
  co_return got;
}

asio::awaitable<Transfer> Stream::WriteSome(BufferPair buffers) {
  error_code error;
  if (state_->expired) co_return tl::unexpected(error_code(asio::error::operation_aborted));
  std::size_t sent = 0;
  if (state_->tls) {
    sent = co_await state_->tls->async_write_some(buffers, asio::redirect_error(asio::use_awaitable, error));
  } else {
    sent = co_await state_->socket.async_write_some(buffers, asio::redirect_error(asio::use_awaitable, error));
  }
  if (error && sent == 0) co_return tl::unexpected(error);
  co_return sent;
}

Transfer Stream::ReadReady(asio::mutable_buffer buffer) {
  if (state_->tls) return std::size_t{0};
  error_code error;
  const std::size_t available = state_->socket.available(error);
  if (error) return tl::unexpected(error);
  if (available == 0) return std::size_t{0};
  const std::size_t got = state_->socket.read_some(asio::buffer(buffer, available), error);
  if (error) return tl::unexpected(error);
  return got;
}

Transfer Stream::WriteReady(BufferPair buffers) {
  if (state_->tls) return std::size_t{0};
  error_code error;
  const std::size_t sent = state_->socket.write_some(buffers, error);
  if (error && error != asio::error::would_block) return tl::unexpected(error);
  return sent;
}

void Stream::SendAhead(std::string_view bytes) {
  if (state_->ahead == 0) state_->ahead = WriteReady({asio::buffer(bytes), asio::const_buffer()}).value_or(0);
}

std::size_t Stream::TakeBytesSentAhead() { return std::exchange(state_->ahead, 0); }

void Stream::Cancel() {
  error_code ignored;
  state_->socket.cancel(ignored);
}

asio::awaitable<void> Stream::FinishWriting() {
  error_code ignored;
  if (state_->tls) co_await state_->tls->async_shutdown(asio::redirect_error(asio::use_awaitable, ignored));
  state_->socket.shutdown(tcp::socket::shutdown_send, ignored);
}

void Stream::Close() {
  error_code ignored;
  state_->socket.close(ignored);
  state_->timer.cancel();
}

void Stream::Reset() {
  error_code ignored;
  state_->socket.set_option(asio::socket_base::linger(true, 0), ignored);
  Close();
}

}  // namespace terrace::server

#include "server/http/listener.h"

#include <spdlog/spdlog.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <future>

namespace terrace::server {
namespace {

using asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::milliseconds kBackOff{10};

Result<tcp::endpoint> Resolve(asio::io_context& io, const std::string& host, std::uint16_t port) {
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';  // as IPv6 stands in URLs
  error_code error;
  const asio::ip::address address = asio::ip::make_address(bracketed ? host.substr(1, host.size() - 2) : host, error);
  if (!error) return tcp::endpoint(address, port);
  tcp::resolver resolver(io);
  const auto found = resolver.resolve(host, "", tcp::resolver::passive, error);
  if (error || found.empty()) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "cannot listen on {}:{}: the host is neither an address nor a name that resolves; give one such as "
        "127.0.0.1, 0.0.0.0 or [::]",
        host, port);
  }
  return tcp::endpoint(found.begin()->endpoint().address(), port);
}

const char* Remedy(const error_code& error) {
  if (error == asio::error::address_in_use) return "stop the process that uses it or choose another port";
  if (error == asio::error::access_denied) return "ports below 1024 need privileges; choose another port";
  return "choose an address of this machine";
}

}  // namespace

Listener::Listener(IoThreads& io, std::shared_ptr<const SessionContext> context)
    : io_(io), context_(std::move(context)), acceptor_(io.first()) {}

Result<std::shared_ptr<Listener>> Listener::Open(IoThreads& io, const std::string& host, std::uint16_t port,
                                                 std::shared_ptr<const SessionContext> context) {
  const Result<tcp::endpoint> endpoint = Resolve(io.first(), host, port);
  if (!endpoint) return tl::unexpected(endpoint.error());
  std::shared_ptr<Listener> listener(new Listener(io, std::move(context)));
  tcp::acceptor& acceptor = listener->acceptor_;
  error_code error;
  acceptor.open(endpoint->protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(*endpoint, error);
  if (!error) acceptor.listen(tcp::acceptor::max_listen_connections, error);
  if (error) {
    return MakeError(ErrorCode::kUnavailable, "cannot listen on {}:{}: {}; {}", host, port, error.message(),
                     Remedy(error));
  }
  listener->port_ = acceptor.local_endpoint().port();
  return listener;
}

void Listener::Start() { asio::co_spawn(acceptor_.get_executor(), Run(shared_from_this()), asio::detached); }

asio::awaitable<void> Listener::Run(std::shared_ptr<Listener> self) { co_await self->AcceptAll(); }

asio::awaitable<void> Listener::AcceptAll() {
  asio::steady_timer timer(acceptor_.get_executor());
  bool crowded = false;
  while (acceptor_.is_open()) {
    error_code error;
    if (!context_->connections->full()) {
      tcp::socket socket =
          co_await acceptor_.async_accept(io_.Next(), asio::redirect_error(asio::use_awaitable, error));
      if (!error) {
        crowded = false;
        StartSession(std::move(socket), context_);
        continue;
      }
      if (error == asio::error::operation_aborted) break;
      if (error == asio::error::connection_aborted) continue;
    }
    if (!crowded) {
      spdlog::warn("accepting no connections for now: {}", error ? error.message() : "as many as configured are open");
    }
    crowded = true;
    context_->connections->CloseIdle();
    timer.expires_after(kBackOff);
    co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, error));
  }
}

void Listener::Close() {
  std::promise<void> closed;
  asio::post(acceptor_.get_executor(), [this, &closed] {
    CloseOnItsThread();
    closed.set_value();
  });
  closed.get_future().wait();
}

void Listener::CloseOnItsThread() {
  error_code error;
  acceptor_.cancel(error);
  acceptor_.non_blocking(true, error);
  while (!error && !context_->connections->full()) {
    tcp::socket socket(io_.Next());
    acceptor_.accept(socket, error);
    if (!error) StartSession(std::move(socket), context_);
  }
  acceptor_.close(error);
}

}  // namespace terrace::server

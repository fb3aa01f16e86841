#include "server/http/listener.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <cerrno>
#include <chrono>
#include <exception>
#include <thread>

#include "server/http/http_error.h"

namespace terrace::server {
namespace {

using asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::milliseconds kBackOff{1};
constexpr std::chrono::milliseconds kMoment{100};
constexpr int kRejectedAtOnce = 1000;

Result<tcp::endpoint> Resolve(asio::io_context& io, const std::string& host, std::uint16_t port) {
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';  // the notation of IPv6 in URLs
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
  if (error == asio::error::address_in_use) return "stop the process that uses it, or choose another port";
  if (error == asio::error::access_denied) return "ports below 1024 need privileges; choose another port";
  return "choose an address of this machine";
}

tl::unexpected<Error> ListenError(const std::string& host, std::uint16_t port, const error_code& error) {
  return MakeError(ErrorCode::kUnavailable, "cannot listen on {}:{}: {}; {}", host, port, error.message(),
                   Remedy(error));
}

void OpenSpare(const asio::any_io_executor& executor, std::optional<asio::posix::stream_descriptor>& spare) {
  const int descriptor = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (descriptor >= 0) spare.emplace(executor, descriptor);
}

// Logged once until the next connection is accepted.
void Warn(bool& has_warned, const std::string& why) {
  if (!has_warned) spdlog::warn("turning connections away for now: {}", why);
  has_warned = true;
}

Response RefusalOf(int status) {
  Response response =
      ProblemResponse(status, status == 429 ? "too many connections from this address" : "too many connections", "-");
  response.headers.emplace_back("Retry-After", "1");
  return response;
}

Result<void> Bind(tcp::acceptor& acceptor, asio::io_context& io, const std::string& host, std::uint16_t port) {
  const Result<tcp::endpoint> endpoint = Resolve(io, host, port);
  if (!endpoint) return tl::unexpected(endpoint.error());
  error_code error;
  acceptor.open(endpoint->protocol(), error);
  if (!error) acceptor.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor.bind(*endpoint, error);
  if (error) return ListenError(host, port, error);
  return {};
}

}  // namespace

Listener::Listener(IoThreads& io, std::shared_ptr<const SessionContext> context)
    : io_(io), context_(std::move(context)), acceptor_(io.first()) {}

Result<std::shared_ptr<Listener>> Listener::Open(IoThreads& io, const std::string& host, std::uint16_t port,
                                                 std::shared_ptr<const SessionContext> context) {
  std::shared_ptr<Listener> listener(new Listener(io, std::move(context)));
  tcp::acceptor& acceptor = listener->acceptor_;
  if (const Result<void> bound = Bind(acceptor, io.first(), host, port); !bound) return tl::unexpected(bound.error());
  error_code error;
  acceptor.listen(tcp::acceptor::max_listen_connections, error);
  if (error) return ListenError(host, port, error);
  listener->host_ = host;
  listener->port_ = acceptor.local_endpoint().port();
  return listener;
}

Result<std::shared_ptr<Listener>> Listener::Adopt(IoThreads& io, int socket,
                                                  std::shared_ptr<const SessionContext> context) {
  std::shared_ptr<Listener> listener(new Listener(io, std::move(context)));
  tcp::endpoint endpoint;
  socklen_t size = static_cast<socklen_t>(endpoint.capacity());
  error_code error;
  if (::getsockname(socket, endpoint.data(), &size) != 0) error.assign(errno, boost::system::system_category());
  if (!error) listener->acceptor_.assign(endpoint.protocol(), socket, error);
  if (error) return MakeError(ErrorCode::kUnavailable, "cannot listen on socket {}: {}", socket, error.message());
  listener->is_adopted_ = true;
  listener->host_ = endpoint.address().to_string();
  listener->port_ = endpoint.port();
  return listener;
}

// Asio's TCP sockets serve Unix ones as well: reading, writing, waiting and closing are the same, options of TCP are
// refused and not needed. Only the addresses of peers have no meaning.
Result<std::shared_ptr<Listener>> Listener::OpenPath(IoThreads& io, const std::string& path, unsigned mode,
                                                     std::shared_ptr<const SessionContext> context) {
  std::shared_ptr<Listener> listener(new Listener(io, std::move(context)));
  Result<PathSocket> socket = ListenOnPath(path, mode);
  if (!socket) return tl::unexpected(socket.error());
  listener->file_ = std::move(socket->file);
  error_code error;
  listener->acceptor_.assign(tcp::v4(), socket->descriptor, error);
  if (error) {
    ::close(socket->descriptor);
    return MakeError(ErrorCode::kUnavailable, "cannot listen on unix:{}: {}", path, error.message());
  }
  return listener;
}

Result<void> Listener::CheckAddress(const std::string& host, std::uint16_t port) {
  asio::io_context io;
  tcp::acceptor acceptor(io);
  return Bind(acceptor, io, host, port);
}

void Listener::Start() {
  asio::post(acceptor_.get_executor(), [self = shared_from_this()] {
    self->started_ = true;
    if (!self->closing_) self->Spawn();
  });
}

void Listener::Spawn() { asio::co_spawn(acceptor_.get_executor(), Run(shared_from_this()), asio::detached); }

// Its destructor restarts the accepting coroutine, which ends by an exception or is destroyed if there is no memory for
// a connection. Later connections may find memory.
class Listener::Resume {
 public:
  explicit Resume(std::shared_ptr<Listener> listener) : listener_(std::move(listener)) {}
  Resume(const Resume&) = delete;
  Resume& operator=(const Resume&) = delete;
  ~Resume() {
    if (!listener_->acceptor_.is_open()) return;
    UntilThereIsMemory(
        [&] { asio::post(listener_->acceptor_.get_executor(), [listener = listener_] { Again(*listener); }); });
  }

 private:
  static void Again(Listener& listener) {
    UntilThereIsMemory([&] {
      if (listener.acceptor_.is_open()) listener.Spawn();
    });
  }

  // Without the restart, no connection would ever be accepted again.
  template <typename Action>
  static void UntilThereIsMemory(Action action) {
    for (;;) {
      try {
        return action();
      } catch (const std::exception&) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
    }
  }

  const std::shared_ptr<Listener> listener_;
};

asio::awaitable<void> Listener::Run(std::shared_ptr<Listener> self) {
  const Resume resume(self);
  co_await self->AcceptAll();
}

asio::awaitable<void> Listener::AcceptAll() {
  OpenSpare(acceptor_.get_executor(), spare_);
  while (!closing_) {
    error_code error;
    tcp::socket socket = co_await acceptor_.async_accept(io_.Next(), asio::redirect_error(asio::use_awaitable, error));
    if (error == asio::error::operation_aborted || error == asio::error::connection_aborted) continue;
    if (!error) {
      co_await Admit(std::move(socket));
      continue;
    }
    // No descriptors, or no memory for one more.
    Warn(has_warned_, error.message());
    context_->connections->EvictOne("");
    co_await Pause(kBackOff);
    RejectPending();
  }
  Finish();
}

void Listener::Finish() {
  file_.Remove();  // first: later connections would only be refused
  if (!is_adopted_) TakeQueue();
  error_code ignored;
  acceptor_.close(ignored);
  closed_.set_value();
}

asio::awaitable<void> Listener::Pause(std::chrono::milliseconds time) {
  asio::steady_timer timer(acceptor_.get_executor(), time);
  error_code ignored;
  co_await timer.async_wait(asio::redirect_error(asio::use_awaitable, ignored));
}

std::string Listener::ClientOf(const asio::ip::address& peer) const { return context_->application->ClientOf(peer); }

// At the limit, evicts another connection or waits a moment for one to end. After a refusal, the next connections do
// not wait.
asio::awaitable<void> Listener::Admit(tcp::socket socket) {
  error_code error;
  const auto peer = socket.remote_endpoint(error);
  if (error) co_return;  // gone already
  const std::string client = ClientOf(peer.address());
  ConnectionSet& connections = *context_->connections;
  if (connections.HasTooMany(client)) co_return Refuse(socket, 429);
  const bool evicts = connections.full() && connections.EvictOne(client);
  const auto until = std::chrono::steady_clock::now() + (evicts || !has_warned_ ? kMoment : kBackOff);
  while (connections.full() && std::chrono::steady_clock::now() < until) co_await Pause(kBackOff);
  if (connections.full() && !evicts) co_return Refuse(socket, 503);
  has_warned_ = has_warned_ && evicts;  // replacing a connection does not end the overload
  StartSession(std::move(socket), context_, client);
}

// Refuses a limited number of waiting connections.
void Listener::RejectPending() {
  error_code error;
  spare_.reset();
  acceptor_.non_blocking(true, error);
  for (int i = 0; i < kRejectedAtOnce && !error; ++i) {
    tcp::socket socket(io_.first());
    acceptor_.accept(socket, error);
    if (!error) Refuse(socket, 503);
    if (error == asio::error::connection_aborted) error.clear();
  }
  OpenSpare(acceptor_.get_executor(), spare_);
}

// Sends the reason if that does not block, and closes.
void Listener::Refuse(tcp::socket& socket, int status) {
  context_->connections->CountRefused();
  if (status == 503) Warn(has_warned_, "as many connections as configured are open");
  if (context_->tls) return;
  error_code ignored;
  socket.non_blocking(true, ignored);
  const Response response = RefusalOf(status);
  HeadOptions head;
  head.cors = &context_->cors;
  const std::string bytes = SerializeHead(response, head) + *response.body;
  socket.send(asio::buffer(bytes), 0, ignored);
  // Unread bytes would make the kernel send a reset, which discards what the client has not read yet.
  std::array<char, 4096> request;
  socket.receive(asio::buffer(request), 0, ignored);
  socket.shutdown(tcp::socket::shutdown_send, ignored);
}

// The accepting coroutine ends itself, because it may own a connection that has no session yet.
void Listener::Close() {
  asio::post(acceptor_.get_executor(), [this] {
    closing_ = true;
    error_code ignored;
    acceptor_.cancel(ignored);
    if (!started_) Finish();
  });
  closed_.get_future().wait();
}

void Listener::TakeQueue() {
  error_code error;
  acceptor_.non_blocking(true, error);
  while (!error && !context_->connections->full()) {
    tcp::socket socket(io_.Next());
    tcp::endpoint peer;
    acceptor_.accept(socket, peer, error);
    if (!error) StartSession(std::move(socket), context_, ClientOf(peer.address()));
  }
}

}  // namespace terrace::server

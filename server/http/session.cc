#include "server/http/session.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core/buffers_suffix.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <cerrno>
#include <exception>
#include <optional>
#include <random>
#include <variant>

#include "server/http/http_error.h"
#include "server/http/router.h"

namespace terrace::server {
namespace {

namespace beast = boost::beast;
using boost::system::error_code;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kReadBytes = 4096;
// How long, and for how much, a closed connection is read so that the last reply arrives: bytes left unread would make
// the kernel send a reset, which destroys what the client has not read yet.
constexpr std::chrono::milliseconds kLingerTime{500};
constexpr std::size_t kLingerBytes = std::size_t{64} << 20;
// A request that takes longer than this is worth asking whether its client is still there.
constexpr std::chrono::milliseconds kPatience{100};
constexpr int kClientLeft = 499;

std::string NextRequestId() {
  static const std::uint64_t start = std::uint64_t{std::random_device{}()} << 32;
  static std::atomic<std::uint64_t> count{0};
  return fmt::format("{:016x}", start + count.fetch_add(1, std::memory_order_relaxed));
}

constexpr std::string_view kContinue = "HTTP/1.1 100 Continue\r\n\r\n";

bool TakesPost(const Request& request) {
  const Result<Route> route = Match(request.target);
  return route && TakesPost(route->kind);
}

// Asked before a body is read: nothing if it may come.
std::optional<Response> WhyNoBody(const Request& request, std::size_t max_body_bytes) {
  if (!TakesPost(request)) return NoSuchMethodResponse(false, request.id);
  if (request.content_length > max_body_bytes) {
    return ProblemResponse(413, "the request body is too large", request.id);
  }
  return std::nullopt;
}

// Nothing: the connection ended, or was idle for too long.
using HeadRead = std::optional<tl::expected<Request, BadRequest>>;

class Session : public Connection, public std::enable_shared_from_this<Session> {
 public:
  Session(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context)
      : context_(std::move(context)), stream_(std::move(socket)), buffer_(kMaxHeadBytes) {
    error_code error;
    const auto peer = stream_.socket().remote_endpoint(error);
    if (!error) peer_ = fmt::format("{}:{}", peer.address().to_string(), peer.port());
    stream_.socket().set_option(asio::ip::tcp::no_delay(true), error);
    stream_.socket().non_blocking(true, error);
  }
  ~Session() override { context_->connections->Remove(this); }

  static asio::awaitable<void> Run(std::shared_ptr<Session> self) { co_await self->ServeAll(); }

  void CloseIfIdle() override { Post(&Session::CloseIfIdleHere); }
  void Drain() override { Post(&Session::DrainHere); }
  void Abort() override { Post(&Session::AbortHere); }

 private:
  void Post(void (Session::*step)()) {
    asio::dispatch(stream_.get_executor(), [self = shared_from_this(), step] { ((*self).*step)(); });
  }
  void CloseIfIdleHere() {
    if (waiting_ && served_ > 0) DrainHere();
  }
  void DrainHere() {
    closing_ = true;
    if (waiting_) stream_.cancel();
  }
  void AbortHere() {
    closing_ = true;
    stream_.close();
  }

  asio::awaitable<void> ServeAll();
  asio::awaitable<HeadRead> ReadHead();
  bool TakeWhatArrived();
  asio::awaitable<bool> ReadBody(Request& request);
  asio::awaitable<void> Refuse(Request request, Response response);
  asio::awaitable<bool> ServeOne(Request request);
  std::optional<Response> AnswerAtOnce(const Request& request);
  asio::awaitable<std::optional<Response>> AnswerWhileConnected(Request request);
  asio::awaitable<Response> Answer(Request request);
  asio::awaitable<void> ClientLeft();
  asio::awaitable<bool> Write(std::string head, Body body);
  asio::awaitable<void> CloseGently();
  void Report(const Request& request, const Response& response, std::size_t bytes, Clock::time_point begun) const;

  std::string_view Unread() const { return {static_cast<const char*>(buffer_.data().data()), buffer_.size()}; }

  const std::shared_ptr<const SessionContext> context_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;  // what was read and not yet parsed: the next requests of a client that does not wait
  std::string peer_ = "-";
  std::uint64_t served_ = 0;
  bool waiting_ = false;  // for the first byte of a request
  bool closing_ = false;  // after the request at hand
};

asio::awaitable<void> Session::ServeAll() {
  for (;;) {
    HeadRead head = co_await ReadHead();
    if (!head) break;
    if (!*head) {
      Request unparsed;
      unparsed.method_name = "-";
      unparsed.target = "-";
      unparsed.id = NextRequestId();
      Response refusal = ProblemResponse(head->error().status, head->error().detail, unparsed.id);
      co_await Refuse(std::move(unparsed), std::move(refusal));
      break;
    }
    Request request = std::move(**head);
    request.id = NextRequestId();
    if (request.content_length > 0) {
      if (std::optional<Response> why = WhyNoBody(request, context_->options.max_body_bytes)) {
        co_await Refuse(std::move(request), *std::move(why));
        break;
      }
      if (!co_await ReadBody(request)) break;
    }
    const bool keep = co_await ServeOne(std::move(request));
    ++served_;
    if (!keep) break;
  }
  co_await CloseGently();
}

// Answers, and the connection is to be closed: what follows cannot be trusted to be a request.
asio::awaitable<void> Session::Refuse(Request request, Response response) {
  const auto begun = Clock::now();
  co_await Write(SerializeHead(response, request.version, false), response.body);
  Report(request, response, response.body->size(), begun);
}

// False: the client left, or took too long. Memory is taken as bytes arrive, not as they are promised.
asio::awaitable<bool> Session::ReadBody(Request& request) {
  stream_.expires_after(context_->options.header_timeout);
  error_code error;
  if (request.expects_continue && buffer_.size() == 0) {
    co_await asio::async_write(stream_, asio::buffer(kContinue), asio::redirect_error(asio::use_awaitable, error));
    if (error) co_return false;
  }
  for (;;) {
    const std::string_view here = Unread().substr(0, request.content_length - request.body.size());
    request.body.append(here);
    buffer_.consume(here.size());
    if (request.body.size() == request.content_length) co_return true;
    const std::size_t room = std::min(request.content_length - request.body.size(), kMaxHeadBytes);
    const std::size_t got =
        co_await stream_.async_read_some(buffer_.prepare(room), asio::redirect_error(asio::use_awaitable, error));
    buffer_.commit(got);
    if (error) co_return false;
  }
}

asio::awaitable<HeadRead> Session::ReadHead() {
  std::size_t scanned = 0;
  bool begun = buffer_.size() > 0;
  stream_.expires_after(begun || served_ == 0 ? context_->options.header_timeout : context_->options.idle_timeout);
  for (;;) {
    // RFC 9112, section 2.2: empty lines before a request are to be ignored.
    while (Unread().starts_with("\r\n")) {
      buffer_.consume(2);
      scanned = 0;
    }
    if (buffer_.size() > 0) {
      const auto end = FindHeadEnd(Unread(), scanned);
      if (!end) co_return HeadRead(tl::unexpected(end.error()));
      if (*end > 0) {
        HeadRead parsed(ParseHead(Unread().substr(0, *end)));
        buffer_.consume(*end);
        co_return parsed;
      }
      scanned = buffer_.size();
      if (!begun) stream_.expires_after(context_->options.header_timeout);
      begun = true;
    }
    if (closing_ && !begun && !TakeWhatArrived()) co_return std::nullopt;
    if (closing_ && buffer_.size() > scanned) continue;

    const std::size_t room = std::min(kReadBytes, kMaxHeadBytes - buffer_.size());
    waiting_ = !begun;
    error_code error;
    const std::size_t got =
        co_await stream_.async_read_some(buffer_.prepare(room), asio::redirect_error(asio::use_awaitable, error));
    waiting_ = false;
    buffer_.commit(got);
    // A drain cuts the wait short; a request may have arrived in that very moment.
    if (error && !(closing_ && error == asio::error::operation_aborted && stream_.socket().is_open())) {
      co_return std::nullopt;
    }
  }
}

// Reads what the kernel has, without waiting. False: there was nothing.
bool Session::TakeWhatArrived() {
  error_code error;
  const std::size_t available = stream_.socket().available(error);
  if (error || available == 0) return false;
  const std::size_t room = std::min(available, kMaxHeadBytes - buffer_.size());
  buffer_.commit(stream_.socket().read_some(buffer_.prepare(room), error));
  return !error;
}

// False: the connection is to be closed.
asio::awaitable<bool> Session::ServeOne(Request request) {
  const auto begun = Clock::now();
  std::optional<Response> response = AnswerAtOnce(request);
  if (!response) response = co_await AnswerWhileConnected(request);
  if (!response) {
    Response nobody;
    nobody.status = kClientLeft;
    Report(request, nobody, 0, begun);
    stream_.close();
    co_return false;
  }
  const bool keep = request.keep_alive && !response->close && !closing_;
  const bool with_body = request.method != Method::kHead && response->body && response->status != 304;
  const Body body = with_body ? response->body : nullptr;
  const bool written = co_await Write(SerializeHead(*response, request.version, keep), body);
  Report(request, *response, body ? body->size() : 0, begun);
  co_return keep&& written;
}

// Nothing: the answer has to be waited for. Most answers need not be, and then neither a timer nor a second coroutine
// watches the client meanwhile.
std::optional<Response> Session::AnswerAtOnce(const Request& request) {
  if (request.method == Method::kGet || request.method == Method::kHead) {
    try {
      if (context_->quick_handler) return context_->quick_handler(request);
    } catch (const std::exception&) {  // the handler will meet it again, and say so
    }
    return std::nullopt;
  }
  const bool takes_post = TakesPost(request);
  if (request.method == Method::kOptions) return PreflightResponse(takes_post);
  if (request.method == Method::kPost && takes_post) return std::nullopt;
  return NoSuchMethodResponse(takes_post, request.id);
}

// Nothing: the client is gone.
asio::awaitable<std::optional<Response>> Session::AnswerWhileConnected(Request request) {
  using asio::experimental::awaitable_operators::operator||;
  std::variant<Response, std::monostate> first = co_await (Answer(std::move(request)) || ClientLeft());
  if (first.index() == 1) co_return std::nullopt;
  co_return std::move(std::get<0>(first));
}

// Never throws, so that the race above always has a winner.
asio::awaitable<Response> Session::Answer(Request request) {
  const std::string id = request.id;
  Error error;
  try {
    co_return co_await context_->handler(std::move(request));
  } catch (const std::exception& exception) {
    error.message = exception.what();
  }
  co_return BackendErrorResponse(error, id);
}

// Returns when the client has closed or reset the connection. A client that closes only its own direction counts as
// gone as well, once its request takes longer than kPatience: browsers abandon requests that way.
asio::awaitable<void> Session::ClientLeft() {
  asio::ip::tcp::socket& socket = stream_.socket();
  asio::steady_timer patience(stream_.get_executor(), kPatience);
  co_await patience.async_wait(asio::use_awaitable);
  co_await socket.async_wait(asio::ip::tcp::socket::wait_read, asio::use_awaitable);
  char byte;
  const auto peeked = ::recv(socket.native_handle(), &byte, 1, MSG_PEEK | MSG_DONTWAIT);
  if (peeked == 0 || (peeked < 0 && errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) co_return;
  // The next request hides the end of the stream; a reset still shows.
  co_await socket.async_wait(asio::ip::tcp::socket::wait_error, asio::use_awaitable);
}

// False: the client is gone or took nothing for too long.
asio::awaitable<bool> Session::Write(std::string head, Body body) {
  const std::array<asio::const_buffer, 2> parts = {asio::buffer(head),
                                                   body ? asio::buffer(*body) : asio::const_buffer()};
  beast::buffers_suffix<std::array<asio::const_buffer, 2>> left(parts);
  // What the kernel takes at once needs no timer. An error shows again when the rest is written.
  error_code error;
  left.consume(stream_.socket().write_some(left, error));
  while (asio::buffer_size(left) > 0) {
    stream_.expires_after(context_->options.write_timeout);
    const std::size_t sent = co_await stream_.async_write_some(left, asio::redirect_error(asio::use_awaitable, error));
    if (error) co_return false;
    left.consume(sent);
  }
  co_return true;
}

asio::awaitable<void> Session::CloseGently() {
  if (!stream_.socket().is_open()) co_return;
  error_code error;
  stream_.socket().shutdown(asio::ip::tcp::socket::shutdown_send, error);
  stream_.expires_after(kLingerTime);
  for (std::size_t taken = 0; !error && taken < kLingerBytes;) {
    buffer_.clear();
    taken +=
        co_await stream_.async_read_some(buffer_.prepare(kReadBytes), asio::redirect_error(asio::use_awaitable, error));
  }
  stream_.close();
}

void Session::Report(const Request& request, const Response& response, std::size_t bytes,
                     Clock::time_point begun) const {
  ReplyRecord record;
  record.method = request.method_name;
  record.target = request.target;
  record.status = response.status;
  record.body_bytes = bytes;
  record.duration = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - begun);
  record.route = response.route;
  record.cache = response.cache;
  record.request_id = request.id;
  record.peer = peer_;
  context_->observer(record);
}

}  // namespace

void StartSession(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context) {
  const auto executor = socket.get_executor();
  ConnectionSet& connections = *context->connections;
  auto session = std::make_shared<Session>(std::move(socket), std::move(context));
  connections.Add(session);
  asio::co_spawn(executor, Session::Run(std::move(session)), asio::detached);
}

}  // namespace terrace::server

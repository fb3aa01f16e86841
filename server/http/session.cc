#include "server/http/session.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>
#include <exception>
#include <optional>
#include <utility>
#include <variant>

#include "server/http/client_watch.h"
#include "server/http/http_error.h"
#include "server/http/stream.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

using Clock = std::chrono::steady_clock;

// How long, and for how much, a closed connection is read so that the last reply arrives: bytes left unread would make
// the kernel send a reset, which destroys what the client has not read yet.
constexpr std::chrono::milliseconds kLingerTime{500};
constexpr std::size_t kLingerBytes = std::size_t{64} << 20;
constexpr int kClientLeft = 499;

Response Overloaded(std::string_view detail, std::string_view request_id) {
  Response response = ProblemResponse(503, detail, request_id);
  response.headers.emplace_back("Retry-After", "1");
  return response;
}

// Asked before a body is read: nothing if it may come.
std::optional<Response> WhyNoBody(const Request& request, std::size_t max_body_bytes) {
  if (request.content_length > max_body_bytes) {
    return ProblemResponse(413, "the request body is too large", request.id);
  }
  if (!request.fields->content_encoding.empty() && !EqualsIgnoringCase(request.fields->content_encoding, "identity")) {
    Response response = ProblemResponse(415, "bodies with a Content-Encoding are not read", request.id);
    response.headers.emplace_back("Accept-Encoding", "identity");
    return response;
  }
  return std::nullopt;
}

// Off the front.
void Skip(std::size_t bytes, BufferPair& buffers) {
  const std::size_t of_head = std::min(bytes, buffers[0].size());
  buffers[0] += of_head;
  buffers[1] += bytes - of_head;
}

class Session : public Connection, public std::enable_shared_from_this<Session> {
 public:
  Session(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context)
      : context_(std::move(context)),
        stream_(std::move(socket), context_->tls ? context_->tls->Current() : nullptr),
        reader_(stream_, context_->options.read) {
    boost::system::error_code error;
    const auto peer = stream_.socket().remote_endpoint(error);
    if (error) return;
    peer_ = Caller(Canonical(peer.address()));
    peer_text_ = fmt::format("{}:{}", peer_.text, peer.port());
  }
  ~Session() override { context_->connections->Remove(this); }

  static asio::awaitable<void> Run(std::shared_ptr<Session> self) { co_await self->ServeAll(); }

  void CloseIfIdle() override { Post(&Session::CloseIfIdleHere); }
  void Drain() override { Post(&Session::DrainHere); }
  void Abort() override { Post(&Session::AbortHere); }

 private:
  // The request that the session is at, and what is to be told about it.
  struct Exchange {
    Request request;
    Caller caller;
    Clock::time_point begun;  // at the end of its head
  };

  void Post(void (Session::*step)()) {
    asio::dispatch(stream_.socket().get_executor(), [self = shared_from_this(), step] { ((*self).*step)(); });
  }
  void CloseIfIdleHere() {
    if (!reader_.waiting() || served_ == 0) return;
    hurried_ = true;
    reader_.Close();
  }
  void DrainHere() { reader_.Close(); }
  void AbortHere() {
    reader_.Close();
    stream_.Reset();
  }

  asio::awaitable<void> ServeAll();
  asio::awaitable<bool> ServeOne();
  asio::awaitable<void> RefuseMessage(BadRequest why);
  asio::awaitable<bool> ServeLater(Route route);
  std::optional<Response> Refuse(const Result<Route>& route) const;
  asio::awaitable<void> HoldBack();
  std::optional<Response> AnswerAtOnce(const Result<Route>& route) const;
  asio::awaitable<std::optional<Response>> AnswerWhileConnected(Route route, Request request);
  asio::awaitable<Response> Answer(Route route, Request request);
  asio::awaitable<bool> Reply(Response& response);
  asio::awaitable<bool> WriteRest(BufferPair left, std::size_t total);
  asio::awaitable<void> CloseGently();
  void Report(const Response& response, std::size_t bytes);

  const std::shared_ptr<const SessionContext> context_;
  Stream stream_;
  RequestReader reader_;
  Caller peer_;
  std::string peer_text_ = "-";
  Exchange exchange_;
  Clock::time_point replied_;  // when the last reply was told about: the present, once the next request is waited for
  std::uint64_t served_ = 0;
  bool hurried_ = false;  // others wait for this connection's place
};

asio::awaitable<void> Session::ServeAll() {
  stream_.ExpiresAfter(context_->options.read.message);
  const Transfer secured = co_await stream_.Handshake();
  if (!secured) {
    stream_.Close();
    co_return;
  }
  replied_ = Clock::now();
  for (bool keep = true; keep;) {
    const RequestReader::Head head = co_await reader_.ReadHead(exchange_.request, replied_);
    if (!head) break;
    exchange_.begun = Clock::now();
    if (*head) {
      keep = co_await ServeOne();
      ++served_;
    } else {
      exchange_.request = Request();  // not the last one
      exchange_.caller = peer_;
      co_await RefuseMessage(head->error());
      break;
    }
  }
  co_await CloseGently();
}

// What follows cannot be trusted to be a request.
asio::awaitable<void> Session::RefuseMessage(BadRequest why) {
  if (exchange_.request.id.empty()) exchange_.request.id = RequestId::Next();
  Response response = ProblemResponse(why.status, why.detail, exchange_.request.id);
  response.close = true;
  co_await Reply(response);
}

// False: the connection is to be closed.
asio::awaitable<bool> Session::ServeOne() {
  Request& request = exchange_.request;
  request.id = RequestId::Next();
  request.is_https = stream_.is_tls();
  exchange_.caller = context_->gate->Identify(request, peer_);
  const Result<Route> route = Match(request.target);
  std::optional<Response> response = AnswerAtOnce(route);
  if (!response) co_return co_await ServeLater(*route);
  if (response->status == 429) co_await HoldBack();
  co_return co_await Reply(*response);
}

// What has to be waited for: the request's body, and the answer.
asio::awaitable<bool> Session::ServeLater(Route route) {
  Request& request = exchange_.request;
  request.client = Gate::NumberOf(request, exchange_.caller);
  std::optional<TransferBudget::Hold> incoming =
      context_->transfers->TryHold(request.content_length, weak_from_this(), exchange_.begun);
  if (!incoming) {
    Response response = Overloaded("too many request bodies are on their way", request.id);
    response.close = true;
    co_await HoldBack();
    co_return co_await Reply(response);
  }
  if (request.content_length > 0) {
    const tl::expected<void, BadRequest> read = co_await reader_.ReadBody(request);
    if (!read && read.error().status > 0) co_await RefuseMessage(read.error());
    if (!read) co_return false;
    incoming->Settle();  // it is the server's turn
  }
  stream_.ExpiresNever();  // the handlers have deadlines of their own
  std::optional<Response> response = co_await AnswerWhileConnected(route, request);
  if (!response) {
    Response nobody;
    nobody.status = kClientLeft;
    Report(nobody, 0);
    stream_.Close();
    co_return false;
  }
  context_->gate->Mark(request, route, *response);
  const bool keep = co_await Reply(*response);
  request.body = std::string();  // nothing of it is held while the connection waits
  co_return keep;
}

// What can be said without the request's body. Preflights come before access: they carry no token.
std::optional<Response> Session::Refuse(const Result<Route>& route) const {
  const Request& request = exchange_.request;
  const bool takes_post = route && TakesPost(route->kind);
  if (std::optional<Response> refusal = context_->gate->RefuseForRate(request, route, exchange_.caller)) return refusal;
  if (request.method == Method::kOptions) return PreflightResponse(takes_post);
  if (request.method == Method::kOther || (request.method == Method::kPost && !takes_post)) {
    return NoSuchMethodResponse(takes_post, request.id);
  }
  if (!route) return ClientErrorResponse(route.error(), request.id);
  std::optional<Response> refusal = context_->gate->Refuse(request, *route);
  if (!refusal) return WhyNoBody(request, context_->options.max_body_bytes);
  refusal->route = ToString(route->kind);
  return refusal;
}

asio::awaitable<void> Session::HoldBack() {
  stream_.ExpiresNever();
  asio::steady_timer delay(stream_.socket().get_executor(), context_->options.refusal_delay);
  co_await delay.async_wait(asio::use_awaitable);
}

// Nothing: the answer has to be waited for. Most answers need not be, and then neither a timer nor a second coroutine
// watches the client meanwhile.
std::optional<Response> Session::AnswerAtOnce(const Result<Route>& route) const {
  const Request& request = exchange_.request;
  std::optional<Response> response = Refuse(route);
  if (response) {
    // A body may follow that nobody will read.
    response->close = response->close || request.content_length > 0;
    return response;
  }
  if (request.content_length > 0 || !context_->quick_handler) return response;
  try {
    response = context_->quick_handler(*route, request);
  } catch (const std::exception&) {  // the handler will meet it again, and say so
    return std::nullopt;
  }
  if (response) context_->gate->Mark(request, *route, *response);
  return response;
}

// Nothing: the client is gone.
asio::awaitable<std::optional<Response>> Session::AnswerWhileConnected(Route route, Request request) {
  using asio::experimental::awaitable_operators::operator||;
  std::variant<Response, std::monostate> first =
      co_await (Answer(std::move(route), std::move(request)) || ClientLeft(stream_));
  if (first.index() == 1) co_return std::nullopt;
  co_return std::move(std::get<0>(first));
}

// Never throws, so that the race above always has a winner.
asio::awaitable<Response> Session::Answer(Route route, Request request) {
  const RequestId id = request.id;
  Error error;
  try {
    co_return co_await context_->handler(std::move(route), std::move(request));
  } catch (const boost::system::system_error& exception) {
    // The client has left, which nobody needs to be told.
    if (exception.code() == asio::error::operation_aborted) co_return ProblemResponse(503, "cancelled", id);
    error.message = exception.what();
  } catch (const std::exception& exception) {
    error.message = exception.what();
  }
  co_return BackendErrorResponse(error, id);
}

// False: the connection is to be closed. `response` has to live as long.
asio::awaitable<bool> Session::Reply(Response& response) {
  const Request& request = exchange_.request;
  const bool with_body = request.method != Method::kHead && response.status != 304;
  const auto kind = response.is_vital ? TransferBudget::Kind::kVitalReply : TransferBudget::Kind::kReply;
  std::optional<TransferBudget::Hold> room =
      context_->transfers->TryHold(with_body ? response.body : nullptr, weak_from_this(), Clock::now(), kind,
                                   Gate::NumberOf(request, exchange_.caller));
  if (!room) {
    const std::string_view route = response.route;
    const std::string dataset = std::move(response.dataset);
    response = Overloaded("too many replies are on their way", request.id);  // at once: there is no room for the body
    response.route = route;
    response.dataset = dataset;
    room.emplace();
    co_await HoldBack();
  }
  HeadOptions options;
  options.version = request.version;
  options.keep_alive = request.keep_alive && !response.close && !reader_.closing();
  options.cors = &context_->cors;
  options.origin = request.fields->origin;
  const std::string head = SerializeHead(response, options);
  const std::size_t body_bytes = with_body && response.body ? response.body->size() : 0;

  BufferPair left = {asio::buffer(head), body_bytes > 0 ? asio::buffer(*response.body) : asio::const_buffer()};
  // What the kernel takes at once needs no deadline. An error shows again when the rest is written.
  const std::size_t taken = stream_.WriteReady(left).value_or(0);
  Skip(taken, left);
  const bool written = asio::buffer_size(left) == 0 || co_await WriteRest(left, taken);
  Report(response, body_bytes);
  co_return options.keep_alive&& written;
}

// False: the client is gone, took nothing for too long, or takes too little in the long run. `total`: bytes of the
// reply that were written before.
asio::awaitable<bool> Session::WriteRest(BufferPair left, std::size_t total) {
  const SessionOptions& options = context_->options;
  const auto begun = Clock::now();
  while (asio::buffer_size(left) > 0) {
    auto deadline = Clock::now() + options.write_timeout;
    if (options.min_rate > 0) {
      deadline = std::min(deadline,
                          begun + options.write_timeout + std::chrono::milliseconds(total * 1000 / options.min_rate));
    }
    stream_.ExpiresAt(deadline);
    const Transfer sent = co_await stream_.WriteSome(left);
    if (!sent) {
      stream_.Reset();
      co_return false;
    }
    total += *sent;
    Skip(*sent, left);
  }
  co_return true;
}

asio::awaitable<void> Session::CloseGently() {
  if (!stream_.socket().is_open()) co_return;
  if (hurried_) co_return stream_.Close();
  stream_.ExpiresAfter(kLingerTime);
  co_await stream_.FinishWriting();
  co_await reader_.Discard(kLingerBytes);
  stream_.Close();
}

void Session::Report(const Response& response, std::size_t bytes) {
  const Exchange& exchange = exchange_;
  const Request& request = exchange.request;
  replied_ = Clock::now();
  ReplyRecord record;
  record.method = request.method_name;
  record.target = request.target;
  record.status = response.status;
  record.body_bytes = bytes;
  record.duration = std::chrono::duration_cast<std::chrono::microseconds>(replied_ - exchange.begun);
  record.route = response.route;
  record.dataset = response.dataset;
  record.cache = response.cache;
  record.version = request.version;
  record.referer = request.fields->referer;
  record.user_agent = request.fields->user_agent;
  record.request_id = request.id;
  record.peer = peer_text_;
  if (exchange.caller.address != peer_.address) record.client = exchange.caller.text;
  if (request.grant) record.token_name = request.grant->name;
  context_->observer(record);
}

}  // namespace

void StartSession(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context,
                  const std::string& client) {
  const auto executor = socket.get_executor();
  ConnectionSet& connections = *context->connections;
  auto session = std::make_shared<Session>(std::move(socket), std::move(context));
  connections.Add(session, client);
  asio::co_spawn(executor, Session::Run(std::move(session)), asio::detached);
}

}  // namespace terrace::server

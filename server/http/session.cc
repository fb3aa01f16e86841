#include "server/http/session.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>
#include <exception>
#include <functional>
#include <optional>
#include <utility>
#include <variant>

#include "server/http/http_error.h"
#include "server/http/text.h"
#include "server/net/address.h"
#include "server/net/client_watch.h"
#include "server/net/stream.h"

namespace terrace::server {
namespace {

using Clock = std::chrono::steady_clock;

// Limits of time and bytes for reading from a connection that is being closed. Unread bytes would make the kernel send
// a reset, which discards the part of the last reply that the client has not read yet.
constexpr std::chrono::milliseconds kLingerTime{500};
constexpr std::size_t kLingerBytes = std::size_t{64} << 20;
constexpr int kClientLeft = 499;

// Checked before a body is read: nothing if it may be sent.
std::optional<Response> RefuseBody(const Request& request, const Admission& admission) {
  if (request.content_length == 0) return std::nullopt;
  if (request.content_length > admission.max_body_bytes) {
    return ProblemResponse(
        413,
        fmt::format("the body has {} bytes, more than the {} that this URL takes{}{}", request.content_length,
                    admission.max_body_bytes, admission.body_remedy.empty() ? "" : "; ", admission.body_remedy),
        request.id);
  }
  if (!request.fields->content_encoding.empty() && !EqualsIgnoringCase(request.fields->content_encoding, "identity")) {
    Response response = ProblemResponse(415, "bodies with a Content-Encoding are not read", request.id);
    response.headers.emplace_back("Accept-Encoding", "identity");
    return response;
  }
  return std::nullopt;
}

// A request's body and its hold on the transfer budget.
struct HeldBody {
  TransferBudget::Hold room;
  std::string text;
};

class Session : public Connection, public std::enable_shared_from_this<Session> {
 public:
  Session(asio::ip::tcp::socket socket, std::shared_ptr<const SessionContext> context)
      : context_(std::move(context)),
        stream_(std::move(socket), context_->tls ? context_->tls->Current() : nullptr),
        reader_(stream_, context_->options.read),
        displacement_(stream_.socket().get_executor(), Clock::time_point::max()) {
    boost::system::error_code error;
    const auto peer = stream_.socket().remote_endpoint(error);
    handler_ = context_->application->Connect(peer.address());
    if (!error && peer.data()->sa_family == AF_UNIX) {
      peer_text_ = "unix:-";
    } else if (!error) {
      peer_text_ = fmt::format("{}:{}", Canonical(peer.address()).to_string(), peer.port());
    }
  }
  ~Session() override { context_->connections->Remove(this); }

  static asio::awaitable<void> Run(std::shared_ptr<Session> self) { co_await self->ServeAll(); }

  Phase phase() const override { return phase_.load(std::memory_order_relaxed); }
  void Evict() override { Post(&Session::EvictHere); }
  void Drain(Clock::time_point close_at) override {
    Post([close_at](Session& session) { session.reader_.EndSoon(close_at); });
  }
  void Abort() override { Post(&Session::AbortHere); }
  // For another connection that needs the memory of this one's body; Evict is for one that needs its place.
  void Displace() override { Post(&Session::DisplaceHere); }

 private:
  // The current request.
  struct Exchange {
    Request request;
    Admission admission;
    bool has_valid_head = false;
    Clock::time_point begun;  // time at the end of its head
  };

  template <typename Step>
  void Post(Step step) {
    asio::dispatch(stream_.socket().get_executor(), [self = shared_from_this(), step] { std::invoke(step, *self); });
  }
  void EvictHere() {
    hurried_ = true;
    reader_.EndSoon();
    if (phase() == Phase::kServes) return;                    // a request has arrived meanwhile
    if (!reader_.waiting() || served_ == 0) stream_.Reset();  // an unfinished head or handshake
  }
  void AbortHere() {
    reader_.EndSoon();
    stream_.Reset();
  }

  // Does nothing while a reply is being sent: the body is released by then. While ReceiveBody waits for memory, the
  // budget may grant the memory and take it back before ReceiveBody sets has_upload_. Therefore is_receiving_ suffices
  // to set displaced_, and ReceiveBody checks displaced_ after the wait.
  void DisplaceHere() {
    if (!has_upload_ && !is_receiving_) return;
    displaced_ = true;
    if (is_receiving_ && has_upload_) stream_.Cancel();
    displacement_.cancel();
  }

  asio::awaitable<void> ServeAll();
  asio::awaitable<bool> ServeOne();
  asio::awaitable<void> RefuseMessage(BadRequest why);
  asio::awaitable<bool> ReceiveBody();
  asio::awaitable<bool> RefuseUpload();
  asio::awaitable<void> DelayRefusal();
  asio::awaitable<std::monostate> Sleep(std::chrono::milliseconds time);
  asio::awaitable<bool> GiveUp();
  Answer Handle();
  template <typename T>
  asio::awaitable<std::optional<T>> WhileConnected(asio::awaitable<T> waited);
  asio::awaitable<Response> Await(asio::awaitable<Response> answer);
  Response Failed(const std::exception& exception) const;
  asio::awaitable<void> UntilInterrupted();
  using MaybeRoom = std::optional<TransferBudget::Hold>;
  asio::awaitable<std::optional<MaybeRoom>> RoomLater(Response& response);
  TransferBudget::HoldRequest HoldRequestOf(const Response& response) const;
  bool SendsBody(const Response& response) const;
  asio::awaitable<bool> Reply(Response& response, bool is_answer = false);
  asio::awaitable<void> WriteRest(BufferPair& left, std::size_t total, TransferBudget::Hold& room);
  asio::awaitable<void> CloseGently();
  void Report(const Response& response, std::size_t bytes);

  const std::shared_ptr<const SessionContext> context_;
  Stream stream_;
  RequestReader reader_;
  std::unique_ptr<ConnectionHandler> handler_;
  std::string peer_text_ = "-";
  Exchange exchange_;
  // When the last reply was reported. ReadHead takes it for the current time: little time has passed since.
  Clock::time_point replied_;
  std::uint64_t served_ = 0;
  std::atomic<Phase> phase_ = Phase::kReceives;  // written on the session's own thread
  bool hurried_ = false;                         // another connection needs this one's place
  asio::steady_timer displacement_;              // never expires; cancelled when displaced_ is set
  bool has_upload_ = false;                      // the request's body holds memory that others may need
  bool is_receiving_ = false;                    // the body is being read
  bool displaced_ = false;                       // others need the memory of the request's body
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
    if (served_ > 0) phase_.store(Phase::kIdle, std::memory_order_relaxed);
    // Pipelined requests take turns with requests of other connections.
    if (served_ > 0 && reader_.has_unread()) {
      co_await asio::post(stream_.socket().get_executor(), asio::use_awaitable);
    }
    const RequestReader::HeadOutcome head = co_await reader_.ReadHead(exchange_.request, replied_);
    if (!head) break;
    phase_.store(Phase::kServes, std::memory_order_relaxed);
    exchange_.begun = Clock::now();
    exchange_.request.deadline = exchange_.begun + context_->request_time_limit->load(std::memory_order_relaxed);
    exchange_.has_valid_head = false;
    if (!*head) {
      co_await RefuseMessage(head->error());
      break;
    }
    keep = co_await ServeOne();
    ++served_;
  }
  co_await CloseGently();
}

// Refuses bytes that are no valid request. Where the next request begins is unknown: the connection must be closed.
asio::awaitable<void> Session::RefuseMessage(BadRequest why) {
  if (exchange_.request.id.empty()) exchange_.request.id = RequestId::Next();
  Response response = ProblemResponse(why.status, why.detail, exchange_.request.id);
  response.close = true;
  co_await Reply(response);
}

// Returns false if the connection must be closed.
asio::awaitable<bool> Session::ServeOne() {
  Request& request = exchange_.request;
  request.id = RequestId::Next();
  request.is_https = stream_.is_tls();
  Admission& admission = exchange_.admission;
  // A turn that comes later would leave too little time for the answer.
  const auto longest_wait = context_->request_time_limit->load(std::memory_order_relaxed) / 2;
  admission = handler_->Admit(request, longest_wait);
  exchange_.has_valid_head = true;
  if (!admission.refusal) admission.refusal = RefuseBody(request, admission);
  displaced_ = has_upload_ = false;
  if (admission.delays_refusal) {
    co_await DelayRefusal();
  } else if (admission.wait.count() > 0 && !co_await WhileConnected(Sleep(admission.wait))) {
    co_return co_await GiveUp();
  }
  if (admission.refusal) {
    Response& refusal = *admission.refusal;
    refusal.close = refusal.close || request.content_length > 0;  // a body may follow that nobody will read
    co_return co_await Reply(refusal);
  }
  if (request.content_length > 0 && !co_await ReceiveBody()) co_return false;
  Answer answer = Handle();
  if (auto* later = std::get_if<asio::awaitable<Response>>(&answer)) {
    std::optional<Response> response = co_await WhileConnected(Await(std::move(*later)));
    if (!response) co_return co_await GiveUp();
    answer = *std::move(response);
  }
  co_return co_await Reply(std::get<Response>(answer), /*is_answer=*/true);
}

// For a request whose answer nobody waits for: the connection has ended, or others get the request's memory. Returns
// false, for the caller to return: the connection must be closed.
asio::awaitable<bool> Session::GiveUp() {
  if (displaced_) co_return co_await RefuseUpload();
  Response unsent;
  unsent.status = kClientLeft;
  Report(unsent, 0);
  stream_.Close();
  co_return false;
}

// Returns false if the body did not arrive; the client has been told, and the connection must be closed. Memory for the
// whole of a longer body is taken once kFreeBytes have arrived: announcing a body takes no memory.
asio::awaitable<bool> Session::ReceiveBody() {
  Request& request = exchange_.request;
  auto body = std::make_shared<HeldBody>();
  phase_.store(Phase::kReceives, std::memory_order_relaxed);
  is_receiving_ = true;
  const std::size_t first = std::min(request.content_length, TransferBudget::kFreeBytes);
  // The time in which the body arrives does not count for the deadline: it has limits of its own (ReadTimeouts).
  auto begun = Clock::now();
  tl::expected<void, BadRequest> read = co_await reader_.ReadBody(request, body->text, first);
  request.deadline += Clock::now() - begun;
  if (read && request.content_length > first) {
    TransferBudget::HoldRequest upload;
    upload.kind = TransferBudget::Kind::kUpload;
    upload.bytes = request.content_length;
    upload.client = request.client;
    upload.holder = weak_from_this();
    auto room = co_await WhileConnected(context_->transfers->HoldWhenRoom(std::move(upload), request.deadline));
    if (!room) co_return co_await GiveUp();
    if (!*room) co_return co_await RefuseUpload();
    body->room = **std::move(room);
    has_upload_ = true;
    if (!displaced_) {
      body->text.reserve(request.content_length);
      begun = Clock::now();
      read = co_await reader_.ReadBody(request, body->text, request.content_length);
      request.deadline += Clock::now() - begun;
    }
  }
  is_receiving_ = false;
  if (displaced_ || (!read && read.error().status == 0)) {
    body.reset();  // release its memory while waiting
    co_return co_await GiveUp();
  }
  if (!read) {
    co_await RefuseMessage(read.error());
    co_return false;
  }
  phase_.store(Phase::kServes, std::memory_order_relaxed);
  body->room.EndUpload();
  request.body = RequestBody(std::shared_ptr<const std::string>(body, &body->text));
  co_return true;
}

// Others get its memory: release the body. Returns false, as GiveUp does.
asio::awaitable<bool> Session::RefuseUpload() {
  exchange_.request.body = RequestBody();
  has_upload_ = is_receiving_ = false;
  Response response = OverloadedResponse("too many request bodies are on their way", exchange_.request.id);
  response.close = true;
  co_await DelayRefusal();
  co_await Reply(response);
  co_return false;
}

asio::awaitable<void> Session::DelayRefusal() {
  stream_.ExpiresNever();
  co_await Sleep(kRefusalDelay);
}

asio::awaitable<std::monostate> Session::Sleep(std::chrono::milliseconds time) {
  asio::steady_timer timer(stream_.socket().get_executor(), time);
  co_await timer.async_wait(asio::use_awaitable);
  co_return std::monostate();
}

// Returns nothing if the client is gone, or if others get the request's memory. For waits of any kind; answers that are
// ready at once need neither a timer nor a second coroutine that watches the client. `waited` must not throw, so that
// the race always has a winner.
template <typename T>
asio::awaitable<std::optional<T>> Session::WhileConnected(asio::awaitable<T> waited) {
  using asio::experimental::awaitable_operators::operator||;
  stream_.ExpiresNever();  // `waited` has its own deadline
  std::variant<T, std::monostate> first = co_await (std::move(waited) || UntilInterrupted());
  if (first.index() == 1) co_return std::nullopt;
  co_return std::move(std::get<0>(first));
}

asio::awaitable<void> Session::UntilInterrupted() {
  using asio::experimental::awaitable_operators::operator||;
  if (!has_upload_) co_return co_await ClientLeft(stream_);
  boost::system::error_code ignored;  // the expected cancellation
  auto displaced = asio::redirect_error(asio::use_awaitable, ignored);
  if (!displaced_) co_await (ClientLeft(stream_) || displacement_.async_wait(std::move(displaced)));
}

Answer Session::Handle() {
  try {
    return handler_->Handle(exchange_.request);
  } catch (const std::exception& exception) {
    return Failed(exception);
  }
}

asio::awaitable<Response> Session::Await(asio::awaitable<Response> answer) {
  try {
    co_return co_await std::move(answer);
  } catch (const std::exception& exception) {
    co_return Failed(exception);
  }
}

Response Session::Failed(const std::exception& exception) const {
  const auto* const of_system = dynamic_cast<const boost::system::system_error*>(&exception);
  // The client has left: nothing to send.
  if (of_system != nullptr && of_system->code() == asio::error::operation_aborted) {
    return ProblemResponse(503, "cancelled", exchange_.request.id);
  }
  return BackendErrorResponse(Error{ErrorCode::kInternal, exception.what()}, exchange_.request.id);
}

bool Session::SendsBody(const Response& response) const {
  return exchange_.request.method != Method::kHead && response.status != 304 && response.body;
}

TransferBudget::HoldRequest Session::HoldRequestOf(const Response& response) const {
  TransferBudget::HoldRequest hold_request;
  hold_request.kind = response.is_vital ? TransferBudget::Kind::kVitalReply : TransferBudget::Kind::kReply;
  hold_request.bytes = SendsBody(response) ? response.body->size() : 0;
  hold_request.body = response.body;
  hold_request.client = exchange_.request.client;
  hold_request.holder = std::const_pointer_cast<Session>(shared_from_this());
  return hold_request;
}

// Releases the reply's body, waits for memory, and makes the reply again, usually from a cache: a waiting body must not
// occupy the memory that it waits for. The outer optional is empty where WhileConnected returns
// nothing; the inner one if there was no memory before the deadline.
asio::awaitable<std::optional<Session::MaybeRoom>> Session::RoomLater(Response& response) {
  for (;;) {
    TransferBudget::HoldRequest hold_request = HoldRequestOf(response);
    const std::size_t bytes = hold_request.bytes;
    hold_request.body = nullptr;
    Response bare;  // response.lines may share ownership of the tile, and so of the body
    bare.labels = std::move(response.labels);
    response = std::move(bare);
    auto wait = context_->transfers->HoldWhenRoom(std::move(hold_request), exchange_.request.deadline);
    auto room = co_await WhileConnected(std::move(wait));
    if (!room || !*room) co_return room;
    Answer again = Handle();
    if (auto* later = std::get_if<asio::awaitable<Response>>(&again)) {
      std::optional<Response> made = co_await WhileConnected(Await(std::move(*later)));
      if (!made) co_return std::nullopt;
      again = *std::move(made);
    }
    response = std::get<Response>(std::move(again));
    response.depends_on_token = response.depends_on_token || exchange_.admission.depends_on_token;
    if (SendsBody(response) && response.body->size() > bytes) continue;  // the dataset may have changed
    (*room)->Keep(response.body);
    co_return room;
  }
}

// Returns false if the connection must be closed. `response` must outlive the call; its body may be replaced.
// `is_answer`: it comes from Handle, which can be called again after a wait for memory; false for refusals.
asio::awaitable<bool> Session::Reply(Response& response, bool is_answer) {
  const Request& request = exchange_.request;
  if (is_answer) response.depends_on_token = response.depends_on_token || exchange_.admission.depends_on_token;
  MaybeRoom room;
  if (!SendsBody(response) || response.body->size() <= TransferBudget::kFreeBytes) {
    room.emplace();
  } else {
    room = context_->transfers->TryHold(HoldRequestOf(response));
  }
  if (!room && is_answer) {
    std::optional<MaybeRoom> later = co_await RoomLater(response);
    if (!later) co_return co_await GiveUp();
    room = *std::move(later);
  }
  if (!room) {
    Response::Labels labels = std::move(response.labels);
    response = OverloadedResponse("too many replies are on their way", request.id);
    labels.cache = response.labels.cache;
    response.labels = std::move(labels);
    room.emplace();
    co_await DelayRefusal();
  }
  has_upload_ = false;
  exchange_.request.body = RequestBody();  // released before the client reads the reply
  HeadOptions options;
  options.version = request.version;
  options.keep_alive = request.keep_alive && !response.close && !reader_.is_ending();
  options.is_private = request.is_private;
  options.cors = &context_->cors;
  options.origin = request.fields->origin;
  const std::string head = SerializeHead(response, options);
  const std::size_t body_bytes = SendsBody(response) ? response.body->size() : 0;

  BufferPair left = {asio::buffer(head), body_bytes > 0 ? asio::buffer(*response.body) : asio::const_buffer()};
  // To find out whether the client is still there, ClientLeft may have sent the bytes that every reply begins with
  // (client_watch.h). They are not sent again.
  Skip(stream_.TakeBytesSentAhead(), left);
  // What the kernel accepts at once needs no deadline. An error occurs again when the rest is written.
  const std::size_t taken = stream_.WriteReady(left).value_or(0);
  Skip(taken, left);
  if (asio::buffer_size(left) > 0) co_await WriteRest(left, taken, *room);
  Report(response, body_bytes - left[1].size());
  co_return options.keep_alive&& asio::buffer_size(left) == 0;
}

// Writes `left`. Bytes remain in it only if the client is gone, has read nothing for too long, or reads too slowly on
// average. `total`: bytes of the reply that were written before. They count for min_rate. `room` does not count them as
// taken by the client, because the kernel may only have buffered them.
asio::awaitable<void> Session::WriteRest(BufferPair& left, std::size_t total, TransferBudget::Hold& room) {
  const SessionOptions& options = context_->options;
  room.BeginReply();
  const auto begun = Clock::now();
  while (asio::buffer_size(left) > 0) {
    auto deadline = Clock::now() + options.write_timeout;
    if (options.min_rate > 0) {
      deadline = std::min(deadline,
                          begun + options.write_timeout + std::chrono::milliseconds(total * 1000 / options.min_rate));
    }
    stream_.ExpiresAt(deadline);
    const Transfer sent = co_await stream_.WriteSome(left);
    if (!sent) co_return stream_.Reset();
    room.AddTaken(*sent);
    total += *sent;
    Skip(*sent, left);
  }
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
  replied_ = Clock::now();
  const auto duration = std::chrono::duration_cast<std::chrono::microseconds>(replied_ - exchange_.begun);
  handler_->Report({exchange_.request, response, bytes, duration, peer_text_, exchange_.has_valid_head});
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

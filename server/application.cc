#include "server/application.h"

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <optional>
#include <utility>

#include "server/api/tile_formats.h"
#include "server/http/http_error.h"
#include "server/routes.h"
#include "server/telemetry/reply_record.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::server {
namespace {

using Clock = JobClock;

// How long a request waits for a replaced source, and how often it checks.
constexpr std::chrono::milliseconds kReplaceTime{3'000}, kReplacePeriod{20};
// A source may be replaced again while it is being opened. If opening still fails after this time, somebody has to
// repair it, and requests do not wait.
constexpr std::chrono::milliseconds kPassingProblem{1'500};

asio::awaitable<void> Pause() {
  asio::steady_timer timer(co_await asio::this_coro::executor, kReplacePeriod);
  co_await timer.async_wait(asio::use_awaitable);
}

// Unknown names must not become labels of metrics.
bool NamesDataset(const Route& route, const Catalog& catalog) {
  return !route.dataset.empty() && FindDataset(route.dataset, catalog.datasets);
}

void SetLabels(const RequestContext& context, const HandlerState& state, Response& response) {
  response.labels.route = context.route.row->label;
  if (NamesDataset(context.route, *state.catalog)) response.labels.subject = context.route.dataset;
}

}  // namespace

// Serves one connection.
class TerrainApplication::Handler final : public ConnectionHandler {
 public:
  Handler(TerrainApplication& application, const asio::ip::address& peer)
      : application_(application), peer_(Canonical(peer)) {}

  Admission Admit(Request& request, std::chrono::milliseconds longest_wait) override {
    AdmissionControl& admission_control = application_.parts_.limits.admission_control;
    context_.request = &request;
    client_ = admission_control.Identify(request, peer_, context_);
    Result<Route> route = Routes().Match(request.target);
    context_.route = route ? *std::move(route) : Route();
    Admission admission;
    const RateLimiter::Turn turn = admission_control.TakeTurn(context_, client_, longest_wait);
    if (!turn.granted) {
      admission.refusal = AdmissionControl::TooManyRequests(turn, context_);
      admission.delays_refusal = true;
      return admission;
    }
    admission.wait = turn.wait;
    admission.refusal = route ? Refuse() : RefuseUnknown(route.error());
    if (admission.refusal) return admission;
    const RouteRow& row = *context_.route.row;
    admission.depends_on_token = admission_control.DependsOnToken(context_);
    if (row.takes_post()) {
      admission.max_body_bytes = row.max_body_bytes(application_.config_at_start_.max_locations);
      admission.body_remedy = "the limit follows from max_locations of this server: send fewer at once";
    }
    return admission;
  }

  Answer Handle(const Request&) override {
    const RouteRow& row = *context_.route.row;
    if (application_.opening() && !row.needs_no_catalog) return AfterOpening();
    HandlerStatePtr state = application_.Current();
    if (std::optional<Response> pending = RefusePending(*state)) return *std::move(pending);
    Answer answer = row.handle(*state, context_);
    auto* response = std::get_if<Response>(&answer);
    if (response == nullptr) return Finish(std::move(state), std::get<asio::awaitable<Response>>(std::move(answer)));
    SetLabels(context_, *state, *response);
    return answer;
  }

  void Report(const SentReply& reply) override;

 private:
  // Preflight requests are answered before access is checked, because they have no token.
  std::optional<Response> RefuseMethod(bool takes_post) const {
    const Request& request = *context_.request;
    if (request.method == Method::kOptions) return PreflightResponse(takes_post);
    if (request.method == Method::kOther || (request.method == Method::kPost && !takes_post)) {
      return NoSuchMethodResponse(takes_post, request.id);
    }
    return std::nullopt;
  }
  std::optional<Response> RefuseUnknown(const Error& error) const {
    std::optional<Response> refusal = RefuseMethod(/*takes_post=*/false);
    return refusal ? std::move(refusal) : ClientErrorResponse(error, context_.request->id);
  }
  std::optional<Response> Refuse() const {
    if (std::optional<Response> refusal = RefuseMethod(context_.route.row->takes_post())) return refusal;
    return application_.parts_.limits.admission_control.Refuse(context_);
  }

  // A dataset that is not open yet.
  std::optional<Response> RefusePending(const HandlerState& state) const {
    const std::vector<std::string>& names = state.catalog->pending;
    if (std::ranges::find(names, context_.route.dataset) == names.end()) return std::nullopt;
    for (const PendingDataset& pending : application_.PendingOf(*state.catalog)) {
      if (pending.name != context_.route.dataset) continue;
      return PendingResponse(pending, context_.request->id);
    }
    return std::nullopt;
  }

  asio::awaitable<Response> AfterOpening();
  asio::awaitable<Response> Finish(HandlerStatePtr state, asio::awaitable<Response> answer);

  TerrainApplication& application_;
  const ClientIdentity peer_;
  ClientIdentity client_;
  RequestContext context_;
};

asio::awaitable<Response> TerrainApplication::Handler::AfterOpening() {
  if (!co_await application_.FirstCatalog(context_.request->deadline)) {
    Response response = ProblemResponse(503, "the sources are being opened", context_.request->id);
    response.headers.emplace_back("Retry-After", "5");
    co_return response;
  }
  Answer answer = Handle(*context_.request);
  if (auto* response = std::get_if<Response>(&answer)) co_return std::move(*response);
  co_return co_await std::get<asio::awaitable<Response>>(std::move(answer));
}

// Keeps the state alive until the answer is ready. If a source turns out to be replaced, the next catalog answers.
asio::awaitable<Response> TerrainApplication::Handler::Finish(HandlerStatePtr state, asio::awaitable<Response> answer) {
  const auto give_up = std::min<Clock::time_point>(Clock::now() + kReplaceTime, context_.request->deadline);
  for (Answer next = std::move(answer);;) {
    if (auto* later = std::get_if<asio::awaitable<Response>>(&next)) {
      Response response = co_await std::move(*later);
      next = std::move(response);
    }
    Response& response = std::get<Response>(next);
    SetLabels(context_, *state, response);
    if (!response.try_again || !application_.parts_.on_source_changed) co_return std::move(response);
    application_.parts_.on_source_changed();
    std::string dataset = response.labels.subject;
    const bool is_replaced = co_await application_.NextCatalog(state, std::move(dataset), give_up);
    if (!is_replaced) co_return std::move(response);
    state = application_.Current();
    next = context_.route.row->handle(*state, context_);
  }
}

void TerrainApplication::Handler::Report(const SentReply& reply) {
  ReplyRecord record = RecordOf(reply);
  // Refusals and requests whose client has left have no labels yet.
  const Route& route = context_.route;
  if (reply.has_valid_head && route.row != nullptr && record.route == Response::Labels().route) {
    record.route = route.row->label;
    if (NamesDataset(route, *application_.catalog())) record.dataset = route.dataset;
  }
  if (reply.has_valid_head && client_.address != peer_.address) record.client = client_.text;
  if (reply.has_valid_head && context_.grant) record.token_name = context_.grant->name;
  application_.parts_.metrics.CountReply(record);
  application_.parts_.access_log.Write(record);
}

TerrainApplication::TerrainApplication(ApplicationParts parts, const config::Config& config)
    : parts_(std::move(parts)), config_at_start_(config), request_time_limit_(config.request_deadline) {
  state_ = Make(std::make_shared<const Catalog>(), config);
}

// Admission keeps the limit of locations and the proxies that were configured at the start. Replies must agree with it.
TerrainApplication::HandlerStatePtr TerrainApplication::Make(CatalogPtr catalog, config::Config config) const {
  config.max_locations = config_at_start_.max_locations;
  config.trusted_proxies = config_at_start_.trusted_proxies;
  config.forwarded_header = config_at_start_.forwarded_header;
  return std::make_shared<const HandlerState>(std::move(catalog), parts_.workers, parts_.tiles, parts_.document_flights,
                                              parts_.viewer, config, *this);
}

std::unique_ptr<ConnectionHandler> TerrainApplication::Connect(const asio::ip::address& peer) {
  return std::make_unique<Handler>(*this, peer);
}

std::string TerrainApplication::ClientOf(const asio::ip::address& peer) const {
  const asio::ip::address address = Canonical(peer);
  return parts_.limits.admission_control.proxies().trusted.Contains(address) ? "" : ClientBlock(address);
}

bool TerrainApplication::Replace(CatalogPtr catalog, const config::Config& config) {
  HandlerStatePtr state = Make(std::move(catalog), config);  // the old one is destroyed after the lock is released
  request_time_limit_.store(config.request_deadline, std::memory_order_relaxed);
  const std::lock_guard lock(mutex_);
  state_.swap(state);
  const bool is_first = opening_.exchange(false);
  if (!is_first) ++replaced_;
  return is_first;
}

void TerrainApplication::SetProblems(std::map<std::string, std::string> problems) {
  const std::lock_guard lock(mutex_);
  const auto now = Clock::now();
  std::erase_if(problem_since_, [&](const auto& known) { return !problems.contains(known.first); });
  for (const auto& [dataset, problem] : problems) problem_since_.try_emplace(dataset, now);
  problems_ = std::move(problems);
}

std::map<std::string, std::string> TerrainApplication::problems() const {
  const std::string cache = parts_.cache_problem ? parts_.cache_problem() : std::string();
  const std::lock_guard lock(mutex_);
  std::map<std::string, std::string> all = problems_;
  if (!cache.empty()) all.emplace(kCacheProblem, cache);
  for (const DatasetView& dataset : state_->catalog->datasets) {
    if (dataset.only_archive && dataset.only_archive->is_outdated()) all.emplace(dataset.name, kArchiveFault);
  }
  return all;
}

// Never 100 %: after the last block other work follows.
std::vector<PendingDataset> TerrainApplication::PendingOf(const Catalog& catalog) const {
  if (catalog.pending.empty()) return {};
  constexpr int kMaxPercent = 99;
  const std::map<std::string, std::string> known_problems = problems();
  std::vector<PendingDataset> pending;
  for (const std::string& name : catalog.pending) {
    const double share = parts_.progress_of ? parts_.progress_of(name) : 0;
    pending.push_back({name, std::clamp(static_cast<int>(100 * share), 0, kMaxPercent), known_problems.contains(name)});
  }
  return pending;
}

std::uint64_t TerrainApplication::replaced() const {
  const std::lock_guard lock(mutex_);
  return replaced_;
}

TerrainApplication::HandlerStatePtr TerrainApplication::Current() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

bool TerrainApplication::HasLastingProblem(const std::string& dataset) const {
  const std::lock_guard lock(mutex_);
  const auto since = problem_since_.find(dataset);
  return since != problem_since_.end() && Clock::now() - since->second >= kPassingProblem;
}

// Returns false if there is none in time, or if the server stops.
asio::awaitable<bool> TerrainApplication::FirstCatalog(Clock::time_point give_up) const {
  while (opening()) {
    if (draining() || Clock::now() >= give_up) co_return false;
    co_await Pause();
  }
  co_return true;
}

// Returns false if none comes in time, if the dataset has a lasting problem, or if the server stops.
asio::awaitable<bool> TerrainApplication::NextCatalog(HandlerStatePtr used, std::string dataset,
                                                      Clock::time_point give_up) const {
  while (Current() == used) {
    if (draining() || HasLastingProblem(dataset) || Clock::now() >= give_up) co_return false;
    co_await Pause();
  }
  co_return true;
}

}  // namespace terrace::server

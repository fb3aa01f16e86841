#include "server/server.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/signal_set.hpp>
#include <condition_variable>
#include <csignal>
#include <functional>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include "server/handlers/metrics.h"
#include "server/handlers/routes.h"
#include "server/handlers/static_files.h"
#include "server/http/edge.h"
#include "server/http/io_threads.h"
#include "server/http/listener.h"
#include "server/http/session.h"

namespace terrace::server {
namespace {

// For replies to requests whose builds were just cancelled, and again for sockets that were just aborted.
constexpr std::chrono::milliseconds kLastWords{1'000};

// A request for heights has a body of at most so many bytes, and so many for each location that it may name: two
// numbers with all their digits, a form's three bytes for each separator.
constexpr std::size_t kBodyBytes = 4096, kBytesPerLocation = 64;

Result<void> CheckNames(const std::vector<DatasetView>& datasets) {
  std::set<std::string_view> names;
  for (const DatasetView& dataset : datasets) {
    if (dataset.name.empty()) return MakeError(ErrorCode::kInvalidArgument, "a dataset has no name; give it one");
    if (IsReservedName(dataset.name) || dataset.name.find('/') != std::string::npos) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "dataset \"{}\": this name is taken by a URL of the server or holds a '/'; choose another",
                       dataset.name);
    }
    if (!names.insert(dataset.name).second) {
      return MakeError(ErrorCode::kInvalidArgument, "dataset \"{}\": two datasets have this name; rename one",
                       dataset.name);
    }
  }
  return {};
}

unsigned IoThreadCount(unsigned configured) {
  return configured > 0 ? configured : std::max(1u, std::thread::hardware_concurrency() / 4);
}

// Sources that workers have open, and what opens files on the way: the log, GDAL's and PROJ's own.
std::size_t DescriptorsForFiles(const ServerOptions& options) {
  const unsigned workers = options.worker_threads > 0 ? options.worker_threads : std::thread::hardware_concurrency();
  return 16 + 4 * std::size_t{workers};
}

TileServiceOptions ServiceOptions(const ServerOptions& options) {
  TileServiceOptions service;
  service.worker_threads = options.worker_threads;
  service.queue_length = options.queue_length;
  service.cache_bytes = options.cache_bytes;
  return service;
}

}  // namespace

// Members are destroyed from the last to the first: the io_contexts, whose unfinished coroutines hold sessions, go
// before everything a session refers to.
class Server::Impl {
 public:
  Impl(std::vector<DatasetView> datasets, TileBuilder builder, StaticFiles viewer, std::unique_ptr<Edge> edge,
       ServerOptions options)
      : options_(std::move(options)),
        datasets_(std::move(datasets)),
        metrics_(datasets_),
        tiles_(ServiceOptions(options_), std::move(builder), std::bind_front(&Metrics::CountBuild, &metrics_)),
        edge_(std::move(edge)),
        routes_(datasets_, tiles_, std::move(viewer), HandlerOptions(), HeightsOptions(), options_.area_mesher,
                RouteState()),
        io_(IoThreadCount(options_.io_threads)),
        signals_(io_.first()) {}

  ~Impl() {
    if (!stopper_.joinable()) return;  // never started
    RequestStop();
    stopper_.join();
  }

  Result<void> Start() {
    Result<std::shared_ptr<Listener>> listener = Listener::Open(io_, options_.host, options_.port, Context());
    if (!listener) return tl::unexpected(listener.error());
    listener_ = std::move(*listener);
    if (options_.stop_on_signals) WatchSignals();
    listener_->Start();
    if (edge_->tls) asio::co_spawn(io_.first(), WatchCertificate(edge_->tls.get()), asio::detached);
    io_.Start();
    stopper_ = std::thread([this] { StopWhenAsked(); });
    return {};
  }

  std::uint16_t port() const { return listener_->port(); }
  const std::string& host() const { return options_.host; }
  bool is_tls() const { return edge_->tls != nullptr; }

  void RequestStop() {
    const std::lock_guard lock(mutex_);
    stop_requested_ = true;
    changed_.notify_all();
  }

  bool Wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stopped_; });
    return drained_;
  }

 private:
  // On a thread of its own, because stopping blocks and joins the others.
  void StopWhenAsked() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_requested_; });
    lock.unlock();
    const bool drained = Stop();
    lock.lock();
    drained_ = drained;
    stopped_ = true;
    changed_.notify_all();
  }

  bool Stop() {
    listener_->Close();
    edge_->connections.Drain();
    const bool drained = edge_->connections.WaitUntilEmpty(options_.drain_timeout);
    tiles_.CancelBuilds();
    if (!drained && !edge_->connections.WaitUntilEmpty(kLastWords)) {
      spdlog::warn("{} connections are cut off: the drain timeout has passed", edge_->connections.size());
      edge_->connections.AbortAll();
      edge_->connections.WaitUntilEmpty(kLastWords);
    }
    io_.Stop();
    tiles_.Shutdown();
    return drained;
  }

  void WatchSignals() {
    signals_.add(SIGINT);
    signals_.add(SIGTERM);
    signals_.async_wait([this](const boost::system::error_code& error, int signal) {
      if (error) return;
      spdlog::info("stopping: signal {}", signal);
      RequestStop();
    });
  }

  TileHandlerOptions HandlerOptions() const {
    TileHandlerOptions handler;
    handler.cache_control = options_.cache_control;
    handler.deadline = options_.request_deadline;
    return handler;
  }

  Routes::Heights HeightsOptions() const { return {options_.read_points, options_.max_locations}; }

  ByteCacheStats RefinementStats() const {
    return options_.refinement_stats ? options_.refinement_stats() : ByteCacheStats{};
  }

  Routes::State RouteState() {
    Routes::State state;
    state.draining = [this] { return edge_->connections.draining(); };
    state.metrics_text = [this] { return metrics_.Text(tiles_.stats(), RefinementStats(), edge_->stats()); };
    return state;
  }

  std::shared_ptr<const SessionContext> Context() {
    auto context = std::make_shared<SessionContext>();
    context->options.read = {options_.header_timeout, options_.idle_timeout};
    context->options.write_timeout = options_.write_timeout;
    context->options.min_rate = options_.min_read_rate;
    context->options.max_body_bytes = kBodyBytes + kBytesPerLocation * options_.max_locations;
    context->quick_handler = std::bind_front(&Routes::ServeAtOnce, &routes_);
    context->handler = std::bind_front(&Routes::Serve, &routes_);
    context->observer = [this](const ReplyRecord& record) {
      metrics_.CountReply(record);
      if (spdlog::should_log(spdlog::level::info)) spdlog::info("{}", FormatAccessLine(record));
    };
    context->connections = &edge_->connections;
    context->transfers = &edge_->transfers;
    context->gate = &edge_->gate;
    context->cors = edge_->cors;
    context->tls = edge_->tls.get();
    return context;
  }

  const ServerOptions options_;
  const std::vector<DatasetView> datasets_;
  Metrics metrics_;
  TileService tiles_;
  const std::unique_ptr<Edge> edge_;
  const Routes routes_;
  IoThreads io_;
  asio::signal_set signals_;
  std::shared_ptr<Listener> listener_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool stop_requested_ = false;
  bool stopped_ = false;
  bool drained_ = false;
  std::thread stopper_;
};

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Server::~Server() = default;

Result<std::unique_ptr<Server>> Server::Start(std::vector<DatasetView> datasets, TileBuilder builder,
                                              ServerOptions options) {
  if (const Result<void> named = CheckNames(datasets); !named) return tl::unexpected(named.error());
  Result<StaticFiles> viewer = StaticFiles::Load(options.viewer_dir);
  if (!viewer) return tl::unexpected(viewer.error());
  Result<std::unique_ptr<Edge>> edge = Edge::Open(options.edge, DescriptorsForFiles(options));
  if (!edge) return tl::unexpected(edge.error());
  auto impl = std::make_unique<Impl>(std::move(datasets), std::move(builder), std::move(*viewer), *std::move(edge),
                                     std::move(options));
  if (const Result<void> started = impl->Start(); !started) return tl::unexpected(started.error());
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

std::uint16_t Server::port() const { return impl_->port(); }

std::string Server::url() const {
  const std::string& host = impl_->host();
  const bool bare_v6 = host.find(':') != std::string::npos && !host.starts_with('[');
  return fmt::format("{}://{}:{}/", impl_->is_tls() ? "https" : "http", bare_v6 ? "[" + host + "]" : host, port());
}

void Server::RequestStop() { impl_->RequestStop(); }
bool Server::Wait() { return impl_->Wait(); }

}  // namespace terrace::server

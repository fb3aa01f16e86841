#include "server/server.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/signal_set.hpp>
#include <condition_variable>
#include <csignal>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

#include "server/access/client_limits.h"
#include "server/admin.h"
#include "server/api/tile_formats.h"
#include "server/application.h"
#include "server/descriptors.h"
#include "server/http/listener.h"
#include "server/http/session.h"
#include "server/net/io_threads.h"
#include "server/telemetry/metrics.h"
#include "server/telemetry/metrics_page.h"

namespace terrace::server {
namespace {

// Time for replies to requests whose builds were just cancelled, and again for sockets that were just aborted; the
// operators' listener takes both once more. Four times this is less than the second that stopping may take beyond the
// drain timeout.
constexpr std::chrono::milliseconds kLastWords{200};

std::string UrlOf(const Listener& listener, bool is_https) {
  if (listener.is_path()) return "unix:" + listener.path();
  const std::string& host = listener.host();
  const bool bare_v6 = host.find(':') != std::string::npos && !host.starts_with('[');
  return fmt::format("{}://{}:{}/", is_https ? "https" : "http", bare_v6 ? "[" + host + "]" : host, listener.port());
}

// Members are destroyed from the last to the first: the io_contexts, whose unfinished coroutines hold sessions, go
// before everything a session refers to.
class RunningServer final : public Server {
 public:
  RunningServer(StaticFiles viewer, AccessLog access_log, std::unique_ptr<ClientLimits> limits, ServerOptions options)
      : options_(std::move(options)),
        access_log_(std::move(access_log)),
        limits_(std::move(limits)),
        workers_(options_.config.worker_threads, options_.config.queue_length),
        tiles_(workers_, {options_.config.cache_bytes, options_.tile_stores, MakeTileHeaders},
               std::bind_front(&Metrics::CountBuild, &metrics_)),
        metrics_page_([this] { return metrics_.Text(CurrentState()); }, options_.metrics_age),
        application_({*limits_, workers_, tiles_, document_flights_, metrics_, metrics_page_, access_log_,
                      std::make_shared<const StaticFiles>(std::move(viewer)), options_.on_source_changed,
                      options_.cache_problem, options_.progress_of},
                     options_.config),
        admin_({workers_, tiles_, options_.refinements.get(), metrics_, metrics_page_, access_log_,
                [this] { return application_.catalog(); }}),
        io_(options_.config.io_threads),
        signals_(io_.first()) {}

  ~RunningServer() override {
    if (!stopper_.joinable()) {  // never started
      io_.Stop();
      workers_.Shutdown();
      return;
    }
    RequestStop();
    stopper_.join();
  }

  Result<void> Run() {
    const config::ListenAddress& listen = options_.config.listen;
    Result<std::shared_ptr<Listener>> listener = options_.listen_socket >= 0
                                                     ? Listener::Adopt(io_, options_.listen_socket, Context())
                                                     : Listener::Open(io_, listen.host, listen.port, Context());
    if (!listener) return tl::unexpected(listener.error());
    listener_ = std::move(*listener);
    if (const Result<void> opened = OpenAdminListener(); !opened) return opened;
    WatchSignals();
    // On an inherited socket, connections wait in its queue until there is something to serve: a stop before that loses
    // none.
    if (options_.listen_socket < 0) listener_->Start();
    if (limits_->tls) asio::co_spawn(io_.first(), WatchCertificate(limits_->tls.get()), asio::detached);
    io_.Start();
    stopper_ = std::thread([this] { StopWhenAsked(); });
    return {};
  }

  void Replace(CatalogPtr catalog, const config::Config& config) override {
    tiles_.SetCacheBytes(config.cache_bytes);
    tiles_.AlsoRetainTilesOf(*catalog);
    const bool is_first = application_.Replace(catalog, config);
    if (is_first && options_.listen_socket >= 0) listener_->Start();
    tiles_.RetainTilesOf(*catalog);
    metrics_.RetainDatasets(catalog->datasets);
  }

  void SetProblems(std::map<std::string, std::string> problems) override {
    application_.SetProblems(std::move(problems));
  }

  void ReopenAccessLog() override { access_log_.Reopen(); }

  std::uint16_t port() const override { return listener_->port(); }
  std::string url() const override { return UrlOf(*listener_, limits_->tls != nullptr); }

  void RequestStop() override {
    const std::lock_guard lock(mutex_);
    stop_requested_ = true;
    changed_.notify_all();
  }

  bool Wait() override {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stopped_; });
    return drained_;
  }

 private:
  Result<void> OpenAdminListener() {
    const std::optional<config::ListenAddress>& address = options_.config.admin_listen;
    if (!address) return {};
    auto listener = address->path.empty()
                        ? Listener::Open(io_, address->host, address->port, AdminContext())
                        : Listener::OpenPath(io_, address->path, options_.config.admin_socket_mode, AdminContext());
    if (!listener) return MakeError(listener.error().code, "admin_listen: {}", listener.error().message);
    admin_listener_ = std::move(*listener);
    spdlog::info("operators: {} answers /admin/purge, /metrics and /version",
                 UrlOf(*admin_listener_, /*is_https=*/false));
    admin_listener_->Start();
    return {};
  }

  // On a separate thread, because stopping blocks and joins the others.
  void StopWhenAsked() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return stop_requested_; });
    lock.unlock();
    if (options_.on_stop) options_.on_stop();
    const bool drained = Stop();
    lock.lock();
    drained_ = drained;
    stopped_ = true;
    changed_.notify_all();
  }

  bool Stop() {
    const std::chrono::milliseconds delay = DrainDelay();
    limits_->connections.Drain(delay, DrainGrace());
    // Waits in full, also while no connection is open: balancers send requests until they have seen /readyz.
    std::this_thread::sleep_for(delay);
    const auto until = std::chrono::steady_clock::now() + options_.config.drain_timeout;
    limits_->connections.WaitUntilEmpty(DrainGrace());
    listener_->Close();
    const bool drained = limits_->connections.WaitUntilEmpty(std::chrono::duration_cast<std::chrono::milliseconds>(
        std::max(until - std::chrono::steady_clock::now(), std::chrono::steady_clock::duration(0))));
    workers_.Cancel();
    // The time beyond the drain timeout is too short to wait for the disk.
    if (!drained) {
      for (tiler::StoreBase* store : Stores()) store->Abandon();
    }
    if (!drained && !limits_->connections.WaitUntilEmpty(kLastWords)) {
      spdlog::warn("{} connections are cut off: the drain timeout has passed", limits_->connections.size());
      limits_->connections.AbortAll();
      limits_->connections.WaitUntilEmpty(kLastWords);
    }
    CloseAdminListener();
    io_.Stop();
    metrics_page_.Stop();
    workers_.Shutdown();
    const char* const stopped = application_.opening() ? "stopped before any dataset was served" : "stopped";
    if (drained) {
      spdlog::info("{}; no request is left unanswered", stopped);
    } else {
      spdlog::warn("{}; some requests were not answered within the drain timeout of {} s", stopped,
                   std::chrono::duration<double>(options_.config.drain_timeout).count());
    }
    return drained;
  }

  // Last, so that operators see the stop.
  void CloseAdminListener() {
    if (!admin_listener_) return;
    admin_connections_.Drain(std::chrono::milliseconds(0), std::chrono::milliseconds(0));
    admin_listener_->Close();
    if (admin_connections_.WaitUntilEmpty(kLastWords)) return;
    admin_connections_.AbortAll();
    admin_connections_.WaitUntilEmpty(kLastWords);
  }

  // No balancer uses a server that was never ready.
  std::chrono::milliseconds DrainDelay() const {
    const bool was_ready = !application_.opening() && !application_.catalog()->datasets.empty();
    return was_ready ? options_.config.drain_delay : std::chrono::milliseconds(0);
  }

  std::chrono::milliseconds DrainGrace() const { return std::min(options_.drain_grace, options_.config.drain_timeout); }

  void WatchSignals() {
    if (options_.stop_on_signals) {
      signals_.add(SIGINT);
      signals_.add(SIGTERM);
    }
    for (const auto& [signal, action] : options_.on_signal) signals_.add(signal);
    WaitForSignal();
  }

  void WaitForSignal() {
    signals_.async_wait([this](const boost::system::error_code& error, int signal) {
      if (error) return;
      if (const auto known = options_.on_signal.find(signal); known != options_.on_signal.end()) {
        known->second();
      } else {
        spdlog::info("stopping: {}; a second one ends the server at once", signal == SIGINT ? "SIGINT" : "SIGTERM");
        for (const int end : {SIGINT, SIGTERM}) {
          signals_.remove(end);
          std::signal(end, [](int) { ::_exit(1); });
        }
        RequestStop();
      }
      WaitForSignal();
    });
  }

  // The tiers below memory.
  std::vector<tiler::StoreBase*> Stores() const {
    std::vector<tiler::StoreBase*> stores;
    for (const auto& store : options_.tile_stores) stores.push_back(store.get());
    if (options_.refinements && options_.refinements->below() != nullptr)
      stores.push_back(options_.refinements->below());
    return stores;
  }

  Metrics::ServerState CurrentState() const {
    Metrics::ServerState state;
    state.tiles = tiles_.stats();
    state.queued = workers_.queued();
    state.in_flight = state.tiles.in_flight + document_flights_.in_flight() + workers_.runs();
    state.joined = state.tiles.joined + document_flights_.joined_total();
    if (options_.refinements) state.refinements = options_.refinements->stats();
    state.stores = Stores();
    state.tile_stores = options_.tile_stores.size();
    state.connections = limits_->connections.size();
    state.refused_connections = limits_->connections.refused();
    state.transfers = limits_->transfers.stats();
    state.catalog = application_.catalog();
    const auto pending = application_.PendingOf(*state.catalog);
    state.problems = application_.problems().size();
    state.problems += static_cast<std::size_t>(std::ranges::count(pending, false, &PendingDataset::has_failed));
    state.catalogs = application_.replaced();
    return state;
  }

  std::shared_ptr<const SessionContext> Context() {
    const config::Config& config = options_.config;
    auto context = std::make_shared<SessionContext>();
    context->options.read = {config.header_timeout, config.idle_timeout, config.min_read_rate};
    context->options.write_timeout = config.write_timeout;
    context->options.min_rate = config.min_read_rate;
    context->application = &application_;
    context->connections = &limits_->connections;
    context->transfers = &limits_->transfers;
    context->request_time_limit = &application_.request_time_limit();
    context->cors = limits_->cors;
    context->tls = limits_->tls.get();
    return context;
  }

  // Without TLS, and not for pages of other origins.
  std::shared_ptr<const SessionContext> AdminContext() {
    auto context = std::make_shared<SessionContext>(*Context());
    context->application = &admin_;
    context->connections = &admin_connections_;
    context->cors = CorsPolicy(std::vector<std::string>());
    context->tls = nullptr;
    return context;
  }

  const ServerOptions options_;
  AccessLog access_log_;
  Metrics metrics_;
  const std::unique_ptr<ClientLimits> limits_;  // jobs of workers hold bodies that count in it
  WorkerPool workers_;
  TileService tiles_;
  DocumentFlights document_flights_{workers_};
  MetricsPage metrics_page_;
  TerrainApplication application_;
  AdminApplication admin_;
  ConnectionSet admin_connections_{kAdminConnections};
  IoThreads io_;
  asio::signal_set signals_;
  std::shared_ptr<Listener> listener_, admin_listener_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool stop_requested_ = false;
  bool stopped_ = false;
  bool drained_ = false;
  std::thread stopper_;
};

}  // namespace

std::vector<Error> Server::CheckStartFiles(const config::Config& config) {
  std::vector<Error> errors;
  const auto note = [&](const auto& opened) {
    if (!opened) errors.push_back(opened.error());
  };
  note(StaticFiles::Load(config.viewer.directory));
  note(AccessLog::Try(config.access_log, config.access_log_file));
  note(ClientLimits::Open(config));
  return errors;
}

Result<void> Server::CheckAddress(const config::Config& config) {
  if (config.admin_listen) {
    const config::ListenAddress& address = *config.admin_listen;
    const Result<void> free =
        address.path.empty() ? Listener::CheckAddress(address.host, address.port) : CheckSocketPath(address.path);
    if (!free) return MakeError(free.error().code, "admin_listen: {}", free.error().message);
  }
  return Listener::CheckAddress(config.listen.host, config.listen.port);
}

Result<std::unique_ptr<Server>> Server::Start(ServerOptions options) {
  const config::Config& config = options.config;
  Result<StaticFiles> viewer = StaticFiles::Load(config.viewer.directory);
  if (!viewer) return tl::unexpected(viewer.error());
  Result<AccessLog> access_log = AccessLog::Open(config.access_log, config.access_log_file);
  if (!access_log) return tl::unexpected(access_log.error());
  Result<std::unique_ptr<ClientLimits>> limits = ClientLimits::Open(config);
  if (!limits) return tl::unexpected(limits.error());
  auto server = std::make_unique<RunningServer>(std::move(*viewer), std::move(*access_log), *std::move(limits),
                                                std::move(options));
  if (const Result<void> started = server->Run(); !started) return tl::unexpected(started.error());
  return server;
}

}  // namespace terrace::server

#include "server/cli/serve/serve_run.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

#include "engine/statistics/cache_folder.h"
#include "server/cli/common/command.h"
#include "server/cli/common/open_cache.h"
#include "server/cli/common/open_dataset.h"
#include "server/cli/common/source_files.h"
#include "server/cli/serve/descriptor_plan.h"
#include "server/cli/serve/log.h"
#include "server/cli/serve/service_manager.h"
#include "server/memory_trimmer.h"
#include "server/store/disk_cache.h"
#include "server/store/shared_cache.h"

namespace terrace::cli {
namespace {

// The configured datasets that are not among the served ones.
std::vector<std::string> PendingOf(const config::Config& config, const std::vector<tiler::Dataset>& served) {
  std::vector<std::string> pending;
  for (const config::DatasetConfig& wanted : config.datasets) {
    if (std::ranges::find(served, wanted.name, &tiler::Dataset::name) == served.end()) pending.push_back(wanted.name);
  }
  return pending;
}

// The time that stopping may take beyond the delay and timeout of the drain.
constexpr std::chrono::seconds kStopTime{1};

// Signals that the running server handles, except those that end it.
const std::vector<int> kHandledSignals = {SIGUSR1, SIGUSR2, SIGHUP};

// `how`: SIG_BLOCK or SIG_UNBLOCK. For this thread and threads that it starts.
void MaskSignals(int how, const std::vector<int>& signals) {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : signals) ::sigaddset(&set, signal);
  ::pthread_sigmask(how, &set, nullptr);
}

}  // namespace

void ShutdownWatchdog::Begin(std::chrono::milliseconds limit) {
  thread_ = std::jthread([limit](const std::stop_token& stop) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any().wait_for(lock, stop, limit, [] { return false; });
    if (stop.stop_requested()) return;
    spdlog::error(
        "stopped: threads that still worked {} s after the signal were cut off; look whether a source can be read",
        std::chrono::duration<double>(limit).count());
    spdlog::default_logger()->flush();
    std::_Exit(kExitFailure);
  });
}

void BlockHandledSignals() { MaskSignals(SIG_BLOCK, kHandledSignals); }

int FailToStart(const Error& error) {
  std::fprintf(stderr, "terrace: %s\n", error.message.c_str());
  return kExitFailure;
}

ServeRun::ServeRun(const ServeArguments& arguments, const config::Config& config, bool is_read_once)
    : arguments_(arguments),
      config_(config),
      is_read_once_(is_read_once),
      baked_(std::make_shared<server::BakedStore>()),
      level_(config.log_level),
      shares_(std::make_shared<PreparationProgress>()),
      watch_(arguments.config_path, [this] { return LoadAgain(); }) {}

Result<void> ServeRun::Start(server::ServerOptions options, std::size_t store_files) {
  if (auto opened = OpenTiers(store_files, options); !opened) return opened;
  cache_ = OpenStatisticsCache(config_);
  options.cache_problem = [folder = cache_.folder] { return folder ? folder->problem() : std::string(); };
  options.progress_of = [shares = shares_](const std::string& dataset) { return shares->Of(dataset); };
  HandleEvents(options);
  auto started = server::Server::Start(std::move(options));
  if (!started) return tl::unexpected(started.error());
  server_ = *std::move(started);
  NotifyOpening();
  return {};
}

Result<void> ServeRun::OpenTiers(std::size_t store_files, server::ServerOptions& options) {
  Result<server::DiskCache> disk;
  if (!config_.disk_cache.directory.empty()) disk = server::OpenDiskCache(config_.disk_cache, store_files);
  if (!disk) return tl::unexpected(disk.error());
  // Archives first: the disk cache then keeps no copies of their tiles.
  options.tile_stores.push_back(baked_);
  if (disk->tiles) options.tile_stores.push_back(std::move(disk->tiles));
  if (!config_.shared_cache.url.empty()) {
    auto shared = server::OpenSharedCache(config_.shared_cache, WorkerThreads(config_));
    if (!shared) return tl::unexpected(shared.error());
    options.tile_stores.push_back(*std::move(shared));
  }
  refinements_ = std::make_shared<tiler::RefinementCache>(config_.refinement_cache_bytes, std::move(disk->refinements));
  options.refinements = refinements_;
  return {};
}

void ServeRun::HandleEvents(server::ServerOptions& options) {
  options.on_source_changed = config_.watch ? std::function<void()>([this] { reloader_->CheckNow(); }) : nullptr;
  options.on_stop = [this] {
    watchdog_.Begin(config_.drain_delay + config_.drain_timeout + kStopTime);
    stop_opening_.request_stop();
    NotifyStopping();
  };
  options.stop_on_signals = true;
  options.on_signal[SIGHUP] = [this] {
    NotifyReloading();
    reloader_->Reload();
  };
  options.on_signal[SIGUSR1] = [] { SetLogLevel(config::LogLevel::kDebug); };
  options.on_signal[SIGUSR2] = [this] { SetLogLevel(level_); };
}

int ServeRun::ServeDatasets() {
  std::optional<FirstDatasets> first = OpenFirstDatasets(config_, cache_, stop_opening_.get_token(), shares_);
  if (stop_opening_.stop_requested()) return server_->Wait() ? kExitOk : kExitFailure;
  if (!first) return kExitFailure;
  baked_->Use(first->open);
  count_ = first->open.size();
  pending_ = first->pending.size();
  is_announced_ = first->pending.empty();
  has_served_nothing_ = first->open.empty();
  reloader_ = std::make_unique<server::Reloader>(config_, std::move(first->slots), MakeHooks());
  server_->Replace(CatalogOf(first->open, first->pending), config_);
  first->open.clear();  // replaced files must not stay open
  shares_->GoToBackground();
  if (is_announced_) {
    AnnounceAll();
  } else {
    std::vector<std::string> shares;
    for (const std::string& name : first->pending) {
      shares.push_back(fmt::format("{} ({:.0f} %)", name, 100 * shares_->Of(name)));
    }
    std::fprintf(stderr, "%sterrace: %s answers; being prepared: %s\n", ::isatty(STDERR_FILENO) != 0 ? "\r\033[K" : "",
                 server_->url().c_str(), fmt::format("{}", fmt::join(shares, ", ")).c_str());
  }
  NotifyReady(ServedText());  // before the reloader's thread may notify newer texts
  reloader_->Start(config_.watch);
  MaskSignals(SIG_UNBLOCK, kHandledSignals);
  const server::MemoryTrimmer trimmer;
  const bool drained = server_->Wait();
  reloader_->Stop();
  return drained && !has_failed_ ? kExitOk : kExitFailure;
}

server::Reloader::Hooks ServeRun::MakeHooks() {
  server::Reloader::Hooks hooks;
  hooks.load = [this] { return watch_.Load(); };
  hooks.file = arguments_.config_file;
  hooks.may_have_changed = [this] { return watch_.MayHaveChanged(); };
  hooks.stop = stop_opening_.get_token();
  hooks.open = [cache = cache_, shares = shares_, end = hooks.stop](const config::DatasetConfig& wanted,
                                                                    const std::stop_token& stop) {
    if (Result<void> files = CheckEditFiles(wanted); !files) {
      return Result<tiler::Dataset>(tl::unexpected(std::move(files).error()));
    }
    std::stop_source either;
    const auto request = [&either] { either.request_stop(); };
    const std::stop_callback on_stop(stop, request), on_end(end, request);
    shares->Begin(wanted.name);
    const auto on_progress = [&](double share) { shares->Raise(wanted.name, share); };
    return OpenDataset(wanted, cache, TERRACE_VERSION, on_progress, either.get_token());
  };
  hooks.publish = [this](const std::vector<tiler::Dataset>& served, const config::Config& now) {
    Publish(served, now);
  };
  hooks.reloaded = [this] {
    server_->ReopenAccessLog();
    NotifyReady(ServedText());
  };
  hooks.report = [this](const std::map<std::string, std::string>& problems) { ReportProblems(problems); };
  return hooks;
}

config::ConfigResult ServeRun::LoadAgain() const {
  if (is_read_once_) return config_;
  if (IsPipe(arguments_.config_path)) {
    return tl::unexpected(std::vector<config::ConfigError>{{"", "has become a pipe or device; make it a file"}});
  }
  std::vector<config::ConfigError> wrong;
  config::Config loaded = MakeConfig(arguments_, wrong);
  if (!wrong.empty()) return tl::unexpected(std::move(wrong));
  return loaded;
}

void ServeRun::Publish(const std::vector<tiler::Dataset>& served, const config::Config& now) {
  if (level_.exchange(now.log_level) != now.log_level) SetLogLevel(now.log_level);
  refinements_->SetCapacity(now.refinement_cache_bytes);
  const std::vector<std::string> pending = PendingOf(now, served);
  std::vector<std::uint64_t> generations;
  for (const tiler::Dataset& dataset : served) generations.push_back(dataset.cache_generation());
  // The tiers know the new datasets before requests for them come, and forget the old ones afterwards.
  baked_->AlsoUse(served);
  refinements_->AlsoRetain(generations);
  server_->Replace(CatalogOf(served, pending), now);
  count_ = served.size();
  pending_ = pending.size();
  has_served_nothing_ = false;
  baked_->Use(served);
  refinements_->Retain(generations);
  if (!pending.empty() || std::exchange(is_announced_, true)) return;
  AnnounceAll();
  NotifyReady(ServedText());
}

// A start of which no dataset can be opened ends the server.
void ServeRun::ReportProblems(const std::map<std::string, std::string>& problems) {
  server_->SetProblems(problems);
  const bool has_nothing = has_served_nothing_ && std::ranges::all_of(config_.datasets, [&](const auto& dataset) {
                             return problems.contains(dataset.name);
                           });
  if (!has_nothing) return;
  for (const auto& [name, problem] : problems) PrintFault(name, problem);
  has_failed_ = true;
  server_->RequestStop();
}

server::CatalogPtr ServeRun::CatalogOf(const std::vector<tiler::Dataset>& served,
                                       std::vector<std::string> pending) const {
  return server::MakeCatalog(std::make_shared<const tiler::TilePipeline>(served, refinements_), std::move(pending));
}

void ServeRun::AnnounceAll() {
  if (cache_.folder) cache_.folder->Trim();  // not before: what is wanted now stays
  fmt::print("terrace: serving {}\n", ServedText());
  std::fflush(stdout);
}

std::string ServeRun::ServedText() const {
  const std::size_t served = count_, pending = pending_;
  return fmt::format("{} dataset{} at {}{}", served, served == 1 ? "" : "s", server_->url(),
                     pending == 0 ? "" : fmt::format(", {} being prepared", pending));
}

}  // namespace terrace::cli

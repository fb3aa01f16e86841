// One run of the server, from the tiers of its cache to its end.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "config/config.h"
#include "config/file/config_watch.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "server/cli/serve/first_datasets.h"
#include "server/cli/serve/serve_config.h"
#include "server/reload/reloader.h"
#include "server/server.h"
#include "server/store/baked_store.h"
#include "server/tiles/catalog.h"
#include "tiler/store/refinement_cache.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {

// Limits the time that the process takes to stop. Jobs check their stop tokens, but a read from a dead mount never
// returns, and its thread cannot be joined.
class ShutdownWatchdog {
 public:
  // Ends the process with status 1 after `limit`, whatever its threads do. Call once.
  void Begin(std::chrono::milliseconds limit);

 private:
  std::jthread thread_;  // ends with this object
};

// Blocks the signals that the running server handles, except those that end it, in this thread and in threads that it
// starts. Before ServeRun installs handlers they would end the process.
void BlockHandledSignals();

// Prints the error. Returns exit code 1, also for kInvalidArgument: the command line was accepted.
int FailToStart(const Error& error);

class ServeRun {
 public:
  // `is_read_once`: the configuration's file is a pipe.
  ServeRun(const ServeArguments& arguments, const config::Config& config, bool is_read_once);

  // Opens the tiers of the cache and listens. Requests wait until ServeDatasets has checked the sources.
  // `store_files`: open files of each store on disk.
  Result<void> Start(server::ServerOptions options, std::size_t store_files);

  // Opens the datasets and serves them until the server stops; large sources are read while it serves. Returns the
  // exit code. Call it once, after Start.
  int ServeDatasets();

 private:
  Result<void> OpenTiers(std::size_t store_files, server::ServerOptions& options);
  void HandleEvents(server::ServerOptions& options);
  server::Reloader::Hooks MakeHooks();
  config::ConfigResult LoadAgain() const;
  void Publish(const std::vector<tiler::Dataset>& served, const config::Config& now);
  void ReportProblems(const std::map<std::string, std::string>& problems);
  server::CatalogPtr CatalogOf(const std::vector<tiler::Dataset>& served, std::vector<std::string> pending) const;
  void AnnounceAll();  // when all datasets of the start are there
  std::string ServedText() const;

  const ServeArguments& arguments_;
  const config::Config& config_;
  const bool is_read_once_;
  // The server, the last member, is destroyed first: its threads use the members before it.
  ShutdownWatchdog watchdog_;  // limits how long the others take to end
  std::stop_source stop_opening_;
  const std::shared_ptr<server::BakedStore> baked_;
  std::shared_ptr<tiler::RefinementCache> refinements_;
  dem::RasterCache cache_;
  std::atomic<config::LogLevel> level_;  // the configured one
  const std::shared_ptr<PreparationProgress> shares_;
  std::atomic<std::size_t> count_{0}, pending_{0};  // of datasets
  // These belong to the reloader's thread once it runs.
  bool is_announced_ = false;
  bool has_served_nothing_ = false;  // nothing was served yet, and the configuration is the first
  std::atomic<bool> has_failed_{false};
  config::ConfigWatch watch_;
  std::unique_ptr<server::Reloader> reloader_;  // once there are datasets to watch
  std::unique_ptr<server::Server> server_;
};

}  // namespace terrace::cli

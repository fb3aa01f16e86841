// The server as one object: start it, request a stop, wait for the end.
// Threads: a few for the network, and a bounded pool for building tiles. A stop has these steps: /readyz reports
// "draining", and every connection closes after its next reply. drain_delay passes. After drain_grace, or as soon as no
// connection is left, idle connections are closed and no new ones are accepted. Requests that have begun are answered,
// within drain_timeout. Builds are cancelled. Threads are joined.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"
#include "tiler/store/refinement_cache.h"

namespace terrace::server {

// The configuration, and what the program that runs the server adds to it.
struct ServerOptions {
  config::Config config;
  int listen_socket = -1;  // used instead of config.listen: a socket that another process keeps open as well
  // Cache tiers of finished tiles below memory, in the order of look-ups.
  std::vector<std::shared_ptr<tiler::TileStore>> tile_stores = {};
  std::shared_ptr<tiler::RefinementCache> refinements = nullptr;  // for metrics, purges and the stop; may be null
  std::function<std::string()> cache_problem = {};                // why cache_dir is not used; "": it is; thread-safe
  // The share done of the pending datasets of a catalog, 0 .. 1; thread-safe; empty: unknown.
  std::function<double(const std::string& dataset)> progress_of = {};
  std::chrono::milliseconds metrics_age{1'000};  // how long a text of /metrics is reused
  // How long new requests are still served after a stop and drain_delay; part of drain_timeout.
  std::chrono::milliseconds drain_grace{500};
  bool stop_on_signals = false;  // SIGINT and SIGTERM act like RequestStop; the second ends the process with status 1
  // Called on an io thread when one of these signals arrives; must not block.
  std::map<int, std::function<void()>> on_signal;
  std::function<void()> on_stop;  // called once, when stopping begins; may be empty
  // Called on io threads when a source file was found changed; must not block. The request then waits a moment for
  // Replace. Empty: sources are not reopened, and requests do not wait.
  std::function<void()> on_source_changed;
};

class Server {
 public:
  // Returns when the server is listening. Requests wait for the first Replace, at most for request_deadline;
  // those that need no catalog, such as /livez, /metrics and /readyz, are answered meanwhile. kInvalidArgument: a
  // trusted proxy, the certificate or its key cannot be used. kUnavailable: the server cannot listen on the address,
  // read the viewer or write the access log. Messages name the remedy.
  static Result<std::unique_ptr<Server>> Start(ServerOptions options);

  // Checks the files that a start needs besides datasets: the viewer, the access log, certificate and key. Returns all
  // errors. Call it before datasets are opened, which may take long.
  static std::vector<Error> CheckStartFiles(const config::Config& config);
  // Checks that the addresses are free.
  static Result<void> CheckAddress(const config::Config& config);

  // Answers new requests from `catalog`. Answers that have begun keep their catalog; a request whose source was
  // replaced, or whose reply waits for memory, is answered anew from the current one. Tiles stay cached if their
  // dataset stays in the same generation. Applies cache_bytes, cache_control, max_mesh_samples and
  // request_deadline of `config`. Datasets that are pending answer 503. Names of datasets are valid (CheckDatasetName)
  // and differ. Functions of the catalog's pipeline that block are called on workers; PlanArea and
  // DatasetView::edits_hash on io threads. May be called on any thread, but not concurrently.
  virtual void Replace(CatalogPtr catalog, const config::Config& config) = 0;

  // Requests a stop and waits for it.
  virtual ~Server() = default;

  // Call it after a rotation of logs.
  virtual void ReopenAccessLog() = 0;

  // Sets the problems that /readyz reports as "degraded" besides cache_problem, by dataset; "" is the configuration.
  // Requests do not wait for a source with a problem.
  virtual void SetProblems(std::map<std::string, std::string> problems) = 0;

  virtual std::uint16_t port() const = 0;
  virtual std::string url() const = 0;  // "http://127.0.0.1:8080/"; https with a certificate

  // Begins to stop and returns at once. Thread-safe, may be called repeatedly; not from a signal handler.
  virtual void RequestStop() = 0;

  // Blocks until a stop was requested and the server has stopped. Running jobs must end first, because a read of a
  // source cannot be cancelled. Returns false if requests were cut off because drain_timeout passed.
  virtual bool Wait() = 0;
};

}  // namespace terrace::server

// The server as one object: start it, ask it to stop, wait until it has.
//
// Threads: a few for the network, a bounded pool for building tiles. Stopping goes in this order: /readyz says
// draining, and every connection ends with its next reply; after drain_grace, or when there is none left, idle
// connections close and no new ones are taken; requests that have begun are answered (bounded by drain_timeout); builds
// are cancelled; threads are joined.
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
#include "server/store/disk_cache.h"
#include "server/tiles/catalog.h"
#include "server/tiles/tile_service.h"

namespace terrace::server {

// The configuration, and what the program that runs the server adds to it.
struct ServerOptions {
  config::Config config;
  int listen_socket = -1;                 // instead of config.listen: one that somebody else holds as well
  std::shared_ptr<DiskCache> disk_cache;  // of finished tiles, below memory; may be null
  std::vector<std::shared_ptr<tiler::TileStore>> tile_stores = {};  // further tiers, below the disk
  std::function<tiler::ByteCacheStats()> refinement_stats;          // of what tiles are made from; may be empty
  std::function<std::string()> cache_trouble = {};  // why sources are not kept in cache_dir, "": they are; thread-safe
  std::chrono::milliseconds metrics_age{1'000};                     // for which a text of /metrics serves
  std::chrono::milliseconds drain_grace{500};  // for which connections are served on; part of drain_timeout
  bool stop_on_signals = false;  // SIGINT and SIGTERM act like RequestStop; the second ends the process with status 1
  // Called on an io thread for each of these signals: must not block.
  std::map<int, std::function<void()>> on_signal;
  std::function<void()> on_stop;  // called once, when stopping begins; may be empty
  // Told that a source is not the one that was opened any more; on io threads, must not block. The request waits a
  // moment for Replace then. Empty: nobody will open it anew, and nobody waits.
  std::function<void()> on_source_changed;
};

class Server {
 public:
  // Listens when it returns. The catalog's functions are called on worker threads. Without a catalog (null) requests
  // wait for the first Replace, for request_deadline at most, while /livez, /metrics and /readyz ("opening") answer.
  // kInvalidArgument: a dataset's name is reserved, empty or used twice. kUnavailable: the address cannot be listened
  // on, the viewer cannot be read, or the access log
  // cannot be written. Messages name the remedy.
  static Result<std::unique_ptr<Server>> Start(CatalogPtr catalog, ServerOptions options);

  // What a start needs besides its datasets: the viewer, the access log and keys of TLS can be read or written.
  // Opening datasets may take long, and whoever waits for that wants to know before: all that is wrong.
  static std::vector<Error> TryFiles(const config::Config& config);
  // And the address is free.
  static Result<void> TryAddress(const config::Config& config);

  // Requests that come from now on are answered from `catalog`; those that have begun keep the one they began with.
  // Cached tiles of datasets that stay in the same generation stay. Of `config`, cache_bytes, cache_control and
  // request_deadline are taken over. kInvalidArgument as above: nothing has changed then. From any thread, one at a
  // time.
  Result<void> Replace(CatalogPtr catalog, const config::Config& config);

  // Stops and waits.
  ~Server();

  // After a rotation.
  void ReopenAccessLog();

  // What /readyz calls degraded besides cache_trouble: troubles by dataset, "" is the configuration. Nobody waits for a source in trouble.
  void SetTroubles(std::map<std::string, std::string> troubles);

  std::uint16_t port() const;
  std::string url() const;  // "http://127.0.0.1:8080/"; https with a certificate

  // Begins to stop and returns at once. From any thread, any number of times; not from a signal handler.
  void RequestStop();

  // Blocks until somebody asks to stop and the server has: at least until the running jobs have ended, for a read of a
  // source cannot be cancelled. False: requests were cut off because drain_timeout passed.
  bool Wait();

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::server

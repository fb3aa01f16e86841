// A flight of one or several clients over a dataset, in real time.
#pragma once

#include <atomic>
#include <functional>

#include "fly/flight/statistics.h"
#include "fly/http/http_client.h"
#include "fly/scene/flight_path.h"
#include "fly/select/select.h"
#include "fly/tree/tile_tree.h"

namespace terrace::fly {

struct FlightOptions {
  Url document;  // a layer.json or tileset.json
  Format format = Format::kTerrain;
  FlightPath path;
  double duration_s = 10;  // of flying, for each client
  Lens lens;
  SelectOptions select;
  double frames_per_second = 60;
  int clients = 1;                                          // client k of n starts at k / n of the path
  int max_loads = 20;                                       // requests of a client at a time
  std::uint64_t max_tile_bytes = std::uint64_t{512} << 20;  // decoded tiles that a client keeps
  double first_view_limit_s = 30;  // a client that has no full first view by then flies without it
  double arrival_limit_s = 10;     // a client waits so long for a full view at the end
  int max_attempts = 6;            // requests for a tile whose failures are transient
  bool keeps_urls = false;         // FlightRecord::urls
  HttpOptions http;                // `threads`, `clients` and `headers_origin` are ignored
};

// Returns when all clients have arrived or `stop` is set. Calls `each_second` after each second, with its index from 0.
void Fly(const FlightOptions& options, const std::atomic<bool>& stop,
         const std::function<void(std::size_t)>& each_second, Statistics& statistics);

}  // namespace terrace::fly

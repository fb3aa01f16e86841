// A flight of one or several clients over a dataset, in real time.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/result.h"
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
  double first_view_limit_s = 30;                           // then the client takes off with what it has
  double arrival_limit_s = 10;
  int max_attempts = 6;  // of a tile that fails in a way that may pass
  HttpOptions http;      // threads and clients are set from the others
};

// Flies to the end, or until `stop`. Calls `each_second` with the number of every second that has passed.
void Fly(const FlightOptions& options, const std::atomic<bool>& stop,
         const std::function<void(std::size_t)>& each_second, Statistics& statistics);

}  // namespace terrace::fly

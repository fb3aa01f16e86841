// The flags of `terrace fly`, and the flight that they describe.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"
#include "fly/flight/flight.h"

namespace CLI {
class App;
}

namespace terrace::cli {

struct FlyArguments {
  std::string url, path, from, to, circle, format = "terrain", report, urls, require;
  double speed = 200, fps = 60, fov = 60, pitch = -20, sse = 16, duration = -1, timeout = 30, first_view_limit = 30;
  int clients = 1, loads = 20, width = 1920, height = 1080, cache_mb = 512;
  bool json = false, forbid_holes = false, insecure = false;
  std::vector<std::string> headers;
};

// Adds the flags to the command; `arguments` outlives it.
void AddFlags(CLI::App& command, FlyArguments& arguments);

// kInvalidArgument or kNotFound: the message names the flag.
Result<fly::FlightOptions> OptionsOf(const FlyArguments& arguments);

}  // namespace terrace::cli

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
  double speed = 200;                          // metres per second
  double fov = 60, pitch = -20;                // degrees
  double sse = 16;                             // pixels
  double duration = -1;                        // seconds; below 0: once along the path, at least 10
  double timeout = 30, first_view_limit = 30;  // seconds
  double fps = 60;
  int clients = 1, loads = 20;
  int width = 1920, height = 1080;  // pixels
  int cache_mib = 512;              // for each client
  bool json = false, forbid_holes = false, insecure = false;
  std::vector<std::string> headers;
};

// Adds the flags to the command; `arguments` outlives it.
void AddFlags(CLI::App& command, FlyArguments& arguments);

// kInvalidArgument or kNotFound: the message names the flag.
Result<fly::FlightOptions> OptionsOf(const FlyArguments& arguments);

}  // namespace terrace::cli

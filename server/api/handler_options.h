// What the configuration says to all handlers.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

namespace terrace::server {

struct HandlerOptions {
  std::string cache_control = "public, max-age=3600";
  std::chrono::milliseconds deadline{30'000};  // of an answer that has to be made
  // How long a refusal for overload is delayed. A client that is refused at once asks again at once, and answering tens
  // of thousands of refusals a second takes from the workers the time they need to become free.
  std::chrono::milliseconds refusal_delay{200};
  std::size_t max_locations = 10'000;  // in one request for heights
};

}  // namespace terrace::server

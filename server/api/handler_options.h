// The part of the configuration that handlers use.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

namespace terrace::server {

struct HandlerOptions {
  std::string cache_control = "public, max-age=3600";  // for requests without a version
  // A literal: the headers in which a trusted proxy reports the origin; empty: no proxy is trusted.
  std::string_view origin_headers = {};
  std::chrono::milliseconds deadline{30'000};  // of an answer that has to be made
  // Delay of a refusal for overload. A client that is refused at once retries at once, and answering tens of thousands
  // of refusals a second would take time from the workers.
  std::chrono::milliseconds refusal_delay{200};
  std::size_t max_locations = 10'000;  // in one request for heights
};

}  // namespace terrace::server

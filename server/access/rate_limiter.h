// Limits how many requests a client may make: one token bucket per client.
//
// Thread-safe. The size is fixed, whatever the number of clients: a table of sets with a few places each. If a set is
// full, the client with the fullest bucket is removed, because it loses the least.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string_view>
#include <vector>

namespace terrace::server {

class RateLimiter {
 public:
  using Clock = std::chrono::steady_clock;

  struct Rate {
    double per_second = 0;  // 0: no limit
    double burst = 0;       // requests at once; at least 1
  };

  RateLimiter();

  struct Turn {
    bool granted = true;
    // Granted: delay before the request continues. Refused: time until a request would be granted.
    std::chrono::milliseconds wait{0};
  };

  // Takes one request from the client's bucket. Grants it also if the bucket will hold one within `longest_wait`.
  Turn Take(std::string_view client, Rate rate, Clock::time_point now, std::chrono::milliseconds longest_wait);

 private:
  static constexpr std::size_t kSets = 16'384, kPlaces = 4, kLocks = 64;

  struct Bucket {
    std::uint64_t client = 0;  // a keyed hash; 0: free
    Clock::time_point filled_at{};
    float level = 0;  // at `filled_at`; below 0: requests are waiting
    float rate = 0, burst = 0;

    double LevelAt(Clock::time_point now) const;
  };

  const std::uint64_t seed_;  // random, so that clients cannot choose their set
  std::vector<Bucket> buckets_;
  std::vector<std::mutex> locks_;
};

}  // namespace terrace::server

// How many requests a client may make: a token bucket for each.
//
// Thread-safe, and of a fixed size whatever the number of clients: a table of sets with a few places each. Where a set
// is full, the client whose bucket is fullest, and who so has the least to be remembered for, is forgotten.
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
    std::chrono::milliseconds wait{0};  // until the request may go on, or until the next one would be granted
  };

  // Takes one request from the client's bucket, also one that will only be there in `longest_wait` or before.
  Turn Take(std::string_view client, Rate rate, Clock::time_point now, std::chrono::milliseconds longest_wait);

 private:
  static constexpr std::size_t kSets = 16'384, kPlaces = 4, kLocks = 64;

  struct Bucket {
    std::uint64_t client = 0;  // a keyed hash; 0: free
    Clock::time_point filled_at{};
    float level = 0;  // at `filled_at`; below 0: requests wait for it
    float rate = 0, burst = 0;

    double LevelAt(Clock::time_point now) const;
  };

  const std::uint64_t seed_;  // so that nobody can choose whom to share a set with
  std::vector<Bucket> buckets_;
  std::vector<std::mutex> locks_;
};

}  // namespace terrace::server

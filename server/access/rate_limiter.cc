#include "server/access/rate_limiter.h"

#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <span>

namespace terrace::server {

RateLimiter::RateLimiter()
    : seed_(std::uint64_t{std::random_device{}()} << 32 | std::random_device{}()),
      buckets_(kSets * kPlaces),
      locks_(kLocks) {}

double RateLimiter::Bucket::LevelAt(Clock::time_point now) const {
  const double seconds = std::max(std::chrono::duration<double>(now - filled_at).count(), 0.0);
  return std::min(level + seconds * rate, static_cast<double>(burst));
}

RateLimiter::Turn RateLimiter::Take(std::string_view client, Rate rate, Clock::time_point now,
                                    std::chrono::milliseconds longest_wait) {
  Turn turn;
  if (rate.per_second <= 0) return turn;
  const std::uint64_t hash = std::max<std::uint64_t>(XXH3_64bits_withSeed(client.data(), client.size(), seed_), 1);
  const std::size_t set = hash % kSets;
  const std::lock_guard lock(locks_[set % kLocks]);
  const std::span<Bucket> places(buckets_.data() + set * kPlaces, kPlaces);
  auto bucket = std::find_if(places.begin(), places.end(), [&](const Bucket& b) { return b.client == hash; });
  if (bucket == places.end()) {
    const auto missing = [&](const Bucket& b) { return b.client == 0 ? -1.0 : b.burst - b.LevelAt(now); };
    bucket = std::min_element(places.begin(), places.end(),
                              [&](const Bucket& a, const Bucket& b) { return missing(a) < missing(b); });
    const auto burst = static_cast<float>(std::max(rate.burst, 1.0));
    *bucket = {hash, now, burst, static_cast<float>(rate.per_second), burst};
  }
  const double level = bucket->LevelAt(now);
  if (level < 1) {
    turn.wait = std::chrono::milliseconds(std::llround(std::ceil((1 - level) / rate.per_second * 1000)));
    turn.granted = turn.wait <= longest_wait;
    if (!turn.granted) {
      turn.wait -= longest_wait;
      return turn;
    }
  }
  bucket->level = static_cast<float>(level - 1);
  bucket->filled_at = now;
  return turn;
}

}  // namespace terrace::server

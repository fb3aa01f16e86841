// A server that answers PING, SET, UNLINK, GETRANGE and SCAN (no keys) as Redis does, or not at all, and counts them.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "redis/address.h"

namespace terrace::server {

// Thread-safe. Replies to GETRANGE with the value that was set last, at first with an empty one.
class FakeRedis {
 public:
  FakeRedis();
  FakeRedis(const FakeRedis&) = delete;
  FakeRedis& operator=(const FakeRedis&) = delete;
  ~FakeRedis();

  const redis::Address& address() const { return address_; }
  void SetValue(const std::string& value);
  void SetReply(const std::string& bytes);
  // Reads and replies nothing, as after a partition; and replies again.
  void FallSilent() { is_silent_ = true; }
  void Speak() { is_silent_ = false; }
  // Reads and replies nothing on the connections that have written, as when a fire wall has dropped them.
  void DropWriters() { drops_ = true; }
  // From now on another server has every lease (SET NX).
  void HoldLeases() { holds_ = true; }
  // Ends one of the connections that are open, or all.
  void CloseOne();
  void CloseAll();

  std::uint64_t pings() const { return pings_; }
  std::uint64_t look_ups() const { return look_ups_; }  // GETRANGE
  std::uint64_t erased() const { return erased_; }      // UNLINK

 private:
  void Accept();
  void Serve(int fd);

  redis::Address address_;
  int listener_ = -1;
  std::atomic<bool> is_silent_{false};
  std::atomic<bool> drops_{false};
  std::atomic<bool> holds_{false};
  std::atomic<std::uint64_t> pings_{0}, look_ups_{0}, erased_{0};
  std::mutex mutex_;  // of what follows
  std::string reply_;
  std::vector<int> open_;
  std::vector<std::jthread> threads_;
  std::jthread accept_;
};

}  // namespace terrace::server

// A key-value store that several servers share: a Redis that may be slow, full, stopped or wrong. Without it tiles are
// built.
//
// Thread-safe. Find and Take block for at most one time-out, on a connection that is open already. Erase blocks until
// Redis has scanned all keys. Opening connections, writing, testing and trying again are the work of a thread of the
// store. After a time-out, or another failure of a connection, the store is switched off for `retry_after`, and then
// until a connection opens and answers within the time-out: meanwhile Find returns at once, without a system call. The
// first look-up that fails ends all others that are under way. So a failing Redis costs one time-out, whatever the
// number of connections and callers. Connections that nobody used for `test_after` are tested, and those that Redis has
// closed are replaced, before a look-up meets them. Log and statistics report when the store is switched off and on.
// All keys begin with "terrace:" in Redis, so that a user's rights can be limited to them.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <unordered_map>
#include <vector>

#include "engine/core/result.h"
#include "redis/connection.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

struct SharedStoreOptions {
  redis::Address address;
  std::string ca_file;                             // redis::ConnectionOptions
  std::chrono::milliseconds timeout{25};           // of a look-up
  std::chrono::seconds ttl{0};                     // of a value; 0: none
  std::size_t max_value_bytes = 0;                 // larger ones are neither sent nor fetched
  std::size_t readers = 1;                         // connections for look-ups: how many run at a time
  std::size_t queue_bytes = std::size_t{8} << 20;  // memory of values that wait to be written; more are dropped
  std::chrono::milliseconds retry_after{1'000};    // between two attempts to connect, or to write what was refused
  std::chrono::milliseconds test_after{5'000};     // a connection that was not used
};

class SharedStore {
 public:
  // Returns at once. A Redis that cannot be reached is no error: the store is switched off until it can.
  explicit SharedStore(SharedStoreOptions options);
  // Writes waiting values, unless Redis fails or this takes longer than half a second.
  ~SharedStore();

  // From now on no value is accepted, and waiting values are dropped. For callers that have no time to wait for Redis.
  void Abandon();

  // Returns nothing if the value is absent, too large or damaged, if Redis failed, or if the store is switched off.
  std::optional<std::string> Find(const std::string& key);

  // `value` is called on the store's thread. `charge`: approximate bytes that it holds until then.
  void Keep(std::string key, std::function<std::string()> value, std::size_t charge);
  // Removes a value that Find returned and that could not be parsed.
  void Forget(const std::string& key);

  // Takes the lease of a key, which ends with Release or after `time`. Blocks for at most one time-out. kHeld: another
  // server has it; wait, and look again. kNone: there is no lease, because the store is switched off, Redis failed, or
  // Redis refuses writes; do not wait.
  enum class Lease { kTaken, kHeld, kNone };
  Lease Take(const std::string& key, std::chrono::milliseconds time);
  // Has an effect only on a lease that this store has taken and that has not ended: another one is another server's.
  void Release(const std::string& key);

  // Erases the values whose keys begin with `prefix` and that `is_chosen` accepts, also those that wait to be written.
  // Opens a connection, and blocks until all keys are scanned. Returns their number. kUnavailable: Redis failed.
  // kCancelled: `stop` was requested. In both cases values may be left.
  Result<std::size_t> Erase(const std::string& prefix, const std::function<bool(std::string_view key)>& is_chosen,
                            const std::stop_token& stop);

  tiler::StoreStats stats() const;

 private:
  using Clock = std::chrono::steady_clock;
  using ConnectionPtr = std::unique_ptr<redis::Connection>;
  struct Job {
    std::string name;                    // of the key, or of its lease, in Redis
    std::function<std::string()> value;  // empty: erase
    std::string key = {};                // of a value
    std::size_t charge = 0;
  };

  Result<ConnectionPtr> Open(std::chrono::milliseconds command_timeout, std::size_t max_reply_bytes) const;
  std::size_t MaxReply() const { return options_.max_value_bytes + 4096; }
  // A command that a caller waits for. Nothing: the store is or was just switched off.
  std::optional<redis::Reply> Ask(const redis::Command& command);
  // A borrowed connection, and the period between two failures that it belongs to.
  struct Loan {
    ConnectionPtr connection;  // null: none
    std::uint64_t epoch = 0;
  };
  Loan Borrow();
  void GiveBack(Loan loan);
  void Drop(Loan loan);
  void SwitchOff(const Error& why, std::uint64_t epoch);
  void Enqueue(Job job);

  // Of the store's thread.
  void Run();
  void Connect();
  void Test();
  Clock::time_point NextTest() const;
  redis::Command CommandOf(const Job& job) const;
  void Write();
  void RefuseWrites(const std::string& why);
  void Report(const std::string& why, bool is_off);

  const SharedStoreOptions options_;
  mutable std::mutex mutex_;  // guards what follows, up to the counters; never held while Redis is waited for
  std::condition_variable_any changed_;
  bool on_ = false;
  std::uint64_t epoch_ = 0;  // counts how often it was switched off; connections of earlier epochs are closed
  struct Idle {
    ConnectionPtr connection;
    Clock::time_point since;
  };
  std::deque<Idle> idle_;                  // for look-ups; the last used one is at the end
  std::set<redis::Connection*> borrowed_;  // of this epoch
  std::size_t open_ = 0;                   // idle or borrowed, of this epoch
  Clock::time_point retry_at_, write_at_;  // earliest time of the next attempt to connect, to write
  std::list<Job> queue_;
  std::size_t queued_bytes_ = 0;
  std::unordered_map<std::string, Clock::time_point> leases_;  // taken and not released, by key: when they end
  bool stop_ = false, abandoned_ = false;
  bool is_writing_ = false;                      // the store's thread has a batch
  std::uint64_t batches_ = 0;                    // that are no longer on their way
  std::vector<std::string> reported_;            // the reasons in the log since reported_at_
  Clock::time_point reported_at_, answered_at_;  // when the log first reported one of them; that Redis answers

  ConnectionPtr writer_;          // of the store's thread
  Clock::time_point written_at_;  // when the writer was used last
  std::atomic<std::uint64_t> hits_{0}, misses_{0}, errors_{0}, damaged_{0}, written_{0}, dropped_{0};
  std::atomic<std::uint64_t> timeouts_{0}, skipped_{0}, switched_off_{0};
  std::thread thread_;
};

}  // namespace terrace::server

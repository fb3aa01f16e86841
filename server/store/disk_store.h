// A key-value store on a disk that may fail: a read returns the value that was written, or nothing.
//
// Thread-safe. Find and Erase block. Keep puts the value into a queue, from which a thread of the store writes it; it
// blocks only if the queue is full and waits_for_room is set. Only Erase returns errors. After a failed
// write the store only reads; after a failed read it neither reads nor writes. It tries again every `retry_after`.
// Log and statistics report this.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/store/record_db.h"
#include "tiler/store/tile_store.h"

namespace terrace::server {

struct DiskStoreOptions {
  RecordDbOptions db;
  std::string name;                                 // in the log: "tiles"
  std::size_t queue_bytes = std::size_t{16} << 20;  // memory of values that wait to be written; more are dropped
  bool waits_for_room = false;                      // Keep waits while the queue is full, instead of dropping
  std::chrono::milliseconds retry_after{2'000};
};

class DiskStore {
 public:
  // If the disk does not respond, the store is switched off until it does; this is no error.
  explicit DiskStore(DiskStoreOptions options);
  // Writes waiting values, unless the disk fails.
  ~DiskStore();

  // From now on no value is accepted, and waiting values are dropped, except those being written (kBatchBytes). For
  // callers that have no time to wait for the disk.
  void Abandon();

  // Returns nothing if the value is absent or damaged, or the disk failed.
  std::optional<std::string> Find(const std::string& key);

  // `value` is called on the store's thread. `charge`: approximate bytes that it holds until then.
  void Keep(std::string key, std::function<std::string()> value, std::size_t charge);

  // Removes a value that Find returned and that could not be parsed.
  void Forget(const std::string& key);

  // Erases the records whose keys begin with one of `prefixes` and that `is_chosen` accepts, also those that wait to be
  // written. Blocks for reads and writes. Returns their number. kUnavailable: the store is switched off, or the disk
  // failed. kInternal: a record is damaged. kCancelled: `stop` was requested. After an error records may be left.
  Result<std::size_t> Erase(const std::vector<std::string>& prefixes,
                            const std::function<bool(std::string_view key)>& is_chosen,
                            const std::stop_token& stop = {});

  // Returns when everything that was kept before the call is written or dropped.
  void Flush();

  tiler::StoreStats stats() const;

  // One write of the database: few enough that erasing and closing do not wait long, many enough that small tiles do
  // not cost a call each.
  static constexpr std::size_t kBatchBytes = std::size_t{1} << 20;

 private:
  struct Job {
    std::string key;
    std::function<std::string()> value;  // empty: erase
    std::size_t charge = 0;
  };

  void Run();
  void Enqueue(Job job);
  void Write(std::list<Job> jobs);
  void Reopen();
  void Open();
  void SwitchOff(const std::string& why, bool reading);

  const DiskStoreOptions options_;
  mutable std::mutex mutex_;  // guards what follows, up to the counters; never held during I/O
  std::condition_variable changed_;
  std::shared_ptr<RecordDb> db_;  // null: nothing is read
  bool writing_ = false;
  std::chrono::steady_clock::time_point retry_at_;  // while not writing
  std::list<Job> queue_;                            // a list, because its jobs can be moved without allocating memory
  std::size_t queued_bytes_ = 0;
  bool busy_ = false;          // jobs have left the queue and are being written
  std::uint64_t batches_ = 0;  // that were written
  bool stop_ = false;
  bool abandoned_ = false;

  std::atomic<std::uint64_t> hits_{0}, misses_{0}, errors_{0}, damaged_{0}, written_{0}, dropped_{0};
  std::atomic<std::size_t> entries_{0}, bytes_{0};
  std::thread thread_;
};

}  // namespace terrace::server

#include "server/store/disk_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <bit>
#include <exception>
#include <utility>

#include "tiler/store/tile_record.h"

namespace terrace::server {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kJobBytes = 256;  // overhead of a job

}  // namespace

DiskStore::DiskStore(DiskStoreOptions options) : options_(std::move(options)) {
  Open();
  thread_ = std::thread([this] { Run(); });
}

DiskStore::~DiskStore() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void DiskStore::Abandon() {
  std::list<Job> waiting;
  {
    const std::lock_guard lock(mutex_);
    abandoned_ = true;
    waiting.swap(queue_);
    for (const Job& job : waiting) queued_bytes_ -= job.charge;
  }
  dropped_.fetch_add(waiting.size(), std::memory_order_relaxed);
  changed_.notify_all();
}

std::optional<std::string> DiskStore::Find(const std::string& key) {
  std::shared_ptr<RecordDb> db;
  {
    const std::lock_guard lock(mutex_);
    db = db_;
  }
  if (!db) {
    misses_.fetch_add(1, std::memory_order_relaxed);
    return std::nullopt;
  }
  Result<std::optional<std::string>> record = db->Get(key);
  if (record && *record) {
    if (const auto value = tiler::StripChecksum(key, **record)) {
      hits_.fetch_add(1, std::memory_order_relaxed);
      (*record)->resize(value->size());  // the checksum is after the value
      return *std::move(record);
    }
    Forget(key);
  } else if (!record && record.error().code == ErrorCode::kInternal) {
    Forget(key);
  } else if (!record) {
    errors_.fetch_add(1, std::memory_order_relaxed);
    SwitchOff(record.error().message, /*reading=*/false);
  }
  misses_.fetch_add(1, std::memory_order_relaxed);
  return std::nullopt;
}

void DiskStore::Keep(std::string key, std::function<std::string()> value, std::size_t charge) {
  Enqueue(Job{std::move(key), std::move(value), charge + kJobBytes});
}

void DiskStore::Forget(const std::string& key) {
  const std::uint64_t damaged = damaged_.fetch_add(1, std::memory_order_relaxed) + 1;
  if (std::has_single_bit(damaged)) {  // 1, 2, 4, 8 ...: a damaged disk does not flood the log
    spdlog::warn("disk cache of {} in {}: {} damaged so far; none is served, check the disk", options_.name,
                 options_.db.directory.string(), damaged == 1 ? "1 record" : fmt::format("{} records", damaged));
  }
  Enqueue(Job{key, nullptr, kJobBytes});
}

Result<std::size_t> DiskStore::Erase(const std::vector<std::string>& prefixes,
                                     const std::function<bool(std::string_view key)>& is_chosen,
                                     const std::stop_token& stop) {
  std::size_t erased = 0;
  std::list<Job> waiting;  // destroyed after the lock is released
  std::shared_ptr<RecordDb> db;
  {
    std::unique_lock lock(mutex_);
    for (auto job = queue_.begin(); job != queue_.end();) {
      const auto here = job++;
      const auto begins = [&](const std::string& prefix) { return here->key.starts_with(prefix); };
      if (!here->value || std::ranges::none_of(prefixes, begins) || !is_chosen(here->key)) continue;
      queued_bytes_ -= here->charge;
      ++erased;
      waiting.splice(waiting.end(), queue_, here);
    }
    // Records that have left the queue are found in the database once they are written.
    const std::uint64_t batch = batches_;
    changed_.wait(lock, [&] { return !busy_ || batches_ != batch; });
    if (writing_) db = db_;
  }
  if (!db) return MakeError(ErrorCode::kUnavailable, "the disk cache of {} is switched off", options_.name);
  Result<void> done;
  for (const std::string& prefix : prefixes) {
    const Result<std::size_t> of_prefix = db->EraseIf(prefix, is_chosen, stop);
    if (!of_prefix) {
      done = tl::unexpected(of_prefix.error());
      break;
    }
    erased += *of_prefix;
  }
  entries_.store(db->entries(), std::memory_order_relaxed);
  bytes_.store(db->bytes(), std::memory_order_relaxed);
  if (done) return erased;
  if (done.error().code == ErrorCode::kCancelled) return tl::unexpected(std::move(done.error()));
  errors_.fetch_add(1, std::memory_order_relaxed);
  SwitchOff(done.error().message, /*reading=*/true);
  return tl::unexpected(std::move(done.error()));
}

void DiskStore::Enqueue(Job job) {
  {
    std::unique_lock lock(mutex_);
    const auto is_off = [this] { return !writing_ || stop_ || abandoned_; };
    const auto has_room = [&] { return queued_bytes_ + job.charge <= options_.queue_bytes; };
    if (options_.waits_for_room) {
      changed_.wait(lock, [&] { return is_off() || has_room() || queued_bytes_ == 0; });
    }
    if (is_off() || !(options_.waits_for_room || has_room())) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    queue_.push_back(std::move(job));
    queued_bytes_ += queue_.back().charge;
  }
  changed_.notify_all();
}

void DiskStore::Flush() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return queue_.empty() && !busy_; });
}

void DiskStore::Run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    const auto has_work = [this] { return stop_ || !queue_.empty(); };
    if (writing_) {
      changed_.wait(lock, [&] { return has_work() || !writing_; });
    } else if (!changed_.wait_until(lock, retry_at_, [this] { return stop_; })) {
      lock.unlock();
      Reopen();
      lock.lock();
      continue;
    }
    if (!queue_.empty()) {
      std::list<Job> jobs;
      std::size_t bytes = 0;
      while (!queue_.empty() && bytes < kBatchBytes) {
        bytes += queue_.front().charge;
        jobs.splice(jobs.end(), queue_, queue_.begin());
      }
      busy_ = true;
      lock.unlock();
      Write(std::move(jobs));
      lock.lock();
      queued_bytes_ -= bytes;  // values being written count, too
      busy_ = false;
      ++batches_;
      changed_.notify_all();
    } else if (stop_) {
      return;
    }
  }
}

void DiskStore::Write(std::list<Job> jobs) {
  std::shared_ptr<RecordDb> db;
  {
    const std::lock_guard lock(mutex_);
    if (writing_) db = db_;
  }
  Result<void> done = MakeError(ErrorCode::kUnavailable, "switched off");
  if (db) {
    try {
      std::vector<RecordDb::Change> changes;
      for (Job& job : jobs) {
        changes.push_back({job.key, std::nullopt});
        if (job.value) changes.back().value = tiler::AddChecksum(job.key, job.value());
      }
      done = db->Write(changes);
    } catch (const std::exception& exception) {  // std::bad_alloc
      done = MakeError(ErrorCode::kUnavailable, "{}", exception.what());
    }
    if (!done) {
      errors_.fetch_add(1, std::memory_order_relaxed);
      SwitchOff(done.error().message, /*reading=*/true);
    }
    entries_.store(db->entries(), std::memory_order_relaxed);
    bytes_.store(db->bytes(), std::memory_order_relaxed);
  }
  (done ? written_ : dropped_).fetch_add(jobs.size(), std::memory_order_relaxed);
}

// Reading continues after a failed write: data on a full disk is still valid.
void DiskStore::SwitchOff(const std::string& why, bool reading) {
  bool was_on = false;
  std::list<Job> waiting;
  std::shared_ptr<RecordDb> closed;  // destroyed after the lock is released
  {
    const std::lock_guard lock(mutex_);
    was_on = writing_;
    writing_ = false;
    retry_at_ = Clock::now() + options_.retry_after;
    waiting.swap(queue_);
    for (const Job& job : waiting) queued_bytes_ -= job.charge;
    if (!reading) closed.swap(db_);
  }
  dropped_.fetch_add(waiting.size(), std::memory_order_relaxed);
  changed_.notify_all();
  if (was_on) {
    spdlog::warn("disk cache of {}: {}; {} and is tried again every {} ms", options_.name, why,
                 reading ? "writing is off" : "it is off", options_.retry_after.count());
  }
}

// Called on the store's thread. After a failed write, a database accepts no more writes until it is reopened, and it
// cannot be opened twice. So it is closed only when the disk accepts a file again.
void DiskStore::Reopen() {
  if (const Result<void> writable = RecordDb::CheckWritable(options_.db); !writable) {
    const std::lock_guard lock(mutex_);
    retry_at_ = Clock::now() + options_.retry_after;
    return;
  }
  std::shared_ptr<RecordDb> old;
  {
    const std::lock_guard lock(mutex_);
    old.swap(db_);
  }
  while (old.use_count() > 1) {  // reads in progress, which may never end
    {
      const std::lock_guard lock(mutex_);
      if (stop_) return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  old.reset();
  Open();
}

void DiskStore::Open() {
  bool discarded = false;
  Result<std::unique_ptr<RecordDb>> db = RecordDb::Open(options_.db, &discarded);
  if (discarded) {
    spdlog::warn("disk cache of {} in {}: too damaged to be opened, begun anew", options_.name,
                 options_.db.directory.string());
  }
  if (!db) {
    const bool first = errors_.fetch_add(1, std::memory_order_relaxed) == 0;
    if (first) {
      spdlog::warn("disk cache of {}: {}; it is off, and tried again every {} ms", options_.name, db.error().message,
                   options_.retry_after.count());
    }
    const std::lock_guard lock(mutex_);
    retry_at_ = Clock::now() + options_.retry_after;
    return;
  }
  entries_.store((*db)->entries(), std::memory_order_relaxed);
  bytes_.store((*db)->bytes(), std::memory_order_relaxed);
  spdlog::info("disk cache of {} in {}: {} records, {:.0f} MB", options_.name, options_.db.directory.string(),
               entries_.load(), static_cast<double>(bytes_.load()) / 1e6);
  const std::lock_guard lock(mutex_);
  db_ = *std::move(db);
  writing_ = true;
}

tiler::StoreStats DiskStore::stats() const {
  tiler::StoreStats stats;
  stats.hits = hits_.load(std::memory_order_relaxed);
  stats.misses = misses_.load(std::memory_order_relaxed);
  stats.errors = errors_.load(std::memory_order_relaxed);
  stats.damaged = damaged_.load(std::memory_order_relaxed);
  stats.written = written_.load(std::memory_order_relaxed);
  stats.dropped = dropped_.load(std::memory_order_relaxed);
  stats.entries = entries_.load(std::memory_order_relaxed);
  stats.bytes = bytes_.load(std::memory_order_relaxed);
  const std::lock_guard lock(mutex_);
  stats.on = writing_ && db_ != nullptr;
  return stats;
}

}  // namespace terrace::server

#include "server/tiles/worker_pool.h"

#include <algorithm>
#include <utility>

namespace terrace::server {
namespace {

// Jobs of a client that may wait for each place that is left: a single one gets two thirds of the queue.
constexpr std::size_t kShare = 2;

// A job goes before one of the next deeper level that has waited for this long.
constexpr std::chrono::milliseconds kAgeOfLevel{100};

}  // namespace

WorkerPool::WorkerPool(unsigned threads, std::size_t queue_length)
    : thread_count_(threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency())),
      queue_length_(queue_length),
      idle_(thread_count_) {
  threads_.reserve(thread_count_);
  for (unsigned i = 0; i < thread_count_; ++i) threads_.emplace_back([this] { Run(); });
}

WorkerPool::~WorkerPool() { Shutdown(); }

bool WorkerPool::TrySubmit(std::function<void()> job, JobOrder order) {
  {
    const std::lock_guard lock(mutex_);
    if (shut_down_ || !HasPlace(order.client)) return false;
    queue_[order.client].emplace(std::chrono::steady_clock::now() + order.level * kAgeOfLevel, std::move(job));
    ++queued_;
  }
  wake_.notify_one();
  return true;
}

bool WorkerPool::HasPlace(std::uint64_t client) const {
  // Jobs that an idle thread is about to fetch are not waiting: a pool with queue length 0 still works.
  const std::size_t places = queue_length_ + idle_;
  if (queued_ >= places) return false;
  const auto own = queue_.find(client);
  return client == 0 || own == queue_.end() || own->second.size() <= kShare * (places - queued_);
}

WorkerPool::Job WorkerPool::TakeNext() {
  auto client = queue_.upper_bound(last_client_);
  if (client == queue_.end()) client = queue_.begin();
  auto& [key, jobs] = *client;
  last_client_ = key;
  Job job = std::move(jobs.begin()->second);
  jobs.erase(jobs.begin());
  if (jobs.empty()) queue_.erase(client);
  --queued_;
  return job;
}

void WorkerPool::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    shut_down_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
}

std::size_t WorkerPool::queued() const {
  const std::lock_guard lock(mutex_);
  return queued_;
}

void WorkerPool::Run() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [this] { return shut_down_ || queued_ > 0; });
    if (queued_ == 0) return;
    Job job = TakeNext();
    --idle_;
    lock.unlock();
    job();
    job = nullptr;  // what it holds is released outside the lock
    lock.lock();
    ++idle_;
  }
}

}  // namespace terrace::server

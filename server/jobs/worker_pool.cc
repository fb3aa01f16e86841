#include "server/jobs/worker_pool.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <chrono>
#include <new>
#include <string>
#include <utility>

namespace terrace::server {

void Wake(WaiterPtr waiter) {
  if (!waiter) return;
  const auto executor = waiter->get_executor();
  // The timer must be destroyed on its own thread, and the posted handler may have run when post() returns. So this
  // thread keeps only a weak pointer.
  const std::weak_ptr<asio::steady_timer> timer = std::exchange(waiter, nullptr);
  while (WaiterPtr here = timer.lock()) {
    try {
      return asio::post(executor, [waiter = std::move(here)] { waiter->cancel(); });
    } catch (const std::exception&) {  // no memory: tries again while the waiter is there
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
}

Error FailureOf(std::string_view name, const std::exception& thrown) {
  const bool is_memory_short = dynamic_cast<const std::bad_alloc*>(&thrown) != nullptr;
  const auto* const error = dynamic_cast<const ThrownError*>(&thrown);
  const ErrorCode code = is_memory_short    ? ErrorCode::kOverloaded
                         : error == nullptr ? ErrorCode::kUnavailable
                                            : error->error().code;
  try {
    // Logged here, because the log leaves out other refusals under load.
    if (is_memory_short)
      spdlog::warn("{}: no memory; give the process more, or lower cache_bytes or worker_threads", name);
    return Error{code, std::string(name) + ": " + (is_memory_short ? "no memory" : thrown.what())};
  } catch (const std::exception&) {
    return Error{code, "no memory"};  // no memory for a longer message either
  }
}

Error DroppedJobError(std::string_view name) {
  try {
    return Error{ErrorCode::kOverloaded, std::string(name) + ": dropped from the full queue of work"};
  } catch (const std::exception&) {
    return Error{ErrorCode::kOverloaded, "no memory"};
  }
}

WorkerPool::WorkerPool(unsigned threads, std::size_t queue_length, Now now)
    : thread_count_(threads > 0 ? threads : std::max(1u, std::thread::hardware_concurrency())),
      queue_length_(queue_length),
      now_(std::move(now)),
      queue_(thread_count_),
      idle_(thread_count_) {
  threads_.reserve(thread_count_);
  for (unsigned i = 0; i < thread_count_; ++i) threads_.emplace_back([this] { Serve(); });
}

WorkerPool::~WorkerPool() { Shutdown(); }

Result<void> WorkerPool::Submit(PoolJobPtr job) {
  PoolJobPtr dropped;
  {
    const std::lock_guard lock(mutex_);
    if (cancel_.stop_requested()) return MakeError(ErrorCode::kCancelled, "the server is shutting down");
    const JobClock::time_point now = now_();
    if (job->terms.deadline <= now) return MakeError(ErrorCode::kCancelled, "the request's deadline has passed");
    // Compared in seconds, because a deadline may be time_point::max().
    if (queue_.ExpectedWait(job->terms, now) > std::chrono::duration<double>(job->terms.deadline - now)) {
      return MakeError(ErrorCode::kOverloaded, "too many jobs are waiting: this job cannot start before its deadline");
    }
    queue_.Push(job, now);
    // Jobs that an idle thread is about to fetch are not waiting: a pool with queue length 0 still works.
    if (queue_.size() > queue_length_ + idle_) dropped = queue_.RemoveNewestOfLargest();
    if (dropped == job) return MakeError(ErrorCode::kOverloaded, "the queue of work is full");
  }
  wake_.notify_one();
  if (dropped && dropped->on_dropped) dropped->on_dropped();
  return {};
}

void WorkerPool::Withdraw(const PoolJobPtr& job) {
  if (!job) return;
  const std::lock_guard lock(mutex_);
  queue_.Remove(job);
}

void WorkerPool::Cancel() { cancel_.request_stop(); }

void WorkerPool::Shutdown() {
  Cancel();
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
  return queue_.size();
}

void WorkerPool::Serve() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [this] { return shut_down_ || queue_.HasNext(); });
    PoolJobPtr job = queue_.Take(now_(), /*any_number_of_long=*/shut_down_);
    if (!job) return;  // shut down
    --idle_;
    lock.unlock();
    job->run();
    job->run = nullptr;  // its captures are released outside the lock
    job->on_dropped = nullptr;
    lock.lock();
    ++idle_;
    queue_.Finish(job, now_());
  }
}

}  // namespace terrace::server

// The threads that compute and read files, behind one queue in which clients take turns (FairQueue).
//
// A job waits; it is refused only where it would have to wait past its deadline, or where more wait than the bound, and
// then it is the newest job of the client that has most waiting. Whoever has nothing to wait for any more withdraws its
// job.
//
// Thread-safe. A job that was taken is run, also during shutdown.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "engine/core/result.h"
#include "server/tiles/fair_queue.h"

namespace terrace::server {

class WorkerPool {
 public:
  using Now = std::function<JobClock::time_point()>;

  // `threads` 0 means as many as the machine has processors. `queue_length` bounds the jobs that wait for a thread.
  WorkerPool(unsigned threads, std::size_t queue_length, Now now = JobClock::now);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // kOverloaded: the job cannot begin before its deadline, or there is no place for it. kUnavailable: the pool is shut
  // down. It will not run then. May call another job's `displaced`.
  Result<void> Submit(PoolJobPtr job);

  // A job that still waits never runs. Null: nothing to do.
  void Withdraw(const PoolJobPtr& job);

  // Takes no more jobs, runs those it has and joins the threads. May be called twice; not from a job.
  void Shutdown();

  std::size_t queued() const;
  unsigned threads() const { return thread_count_; }

 private:
  void Run();

  const unsigned thread_count_;
  const std::size_t queue_length_;
  const Now now_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  FairQueue queue_;
  unsigned idle_ = 0;  // threads without a job
  bool shut_down_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace terrace::server

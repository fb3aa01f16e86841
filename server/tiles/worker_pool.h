// The threads that compute and read files, behind a queue of bounded length.
//
// Thread-safe. A job that was taken is run, also during shutdown; a job that finds the queue full is refused, so that
// the time a request waits is bounded by configuration and not by load.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace terrace::server {

class WorkerPool {
 public:
  // `threads` 0 means as many as the machine has processors. `queue_length` counts the jobs that wait for a thread.
  WorkerPool(unsigned threads, std::size_t queue_length);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // False: the queue is full or the pool is shut down, and `job` will not run. Jobs must not throw.
  [[nodiscard]] bool TrySubmit(std::function<void()> job);

  // Takes no more jobs, runs those it has and joins the threads. May be called twice; not from a job.
  void Shutdown();

  std::size_t queued() const;
  unsigned threads() const { return thread_count_; }

 private:
  void Run();

  const unsigned thread_count_;
  const std::size_t queue_length_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> queue_;
  unsigned idle_ = 0;  // threads without a job
  bool shut_down_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace terrace::server

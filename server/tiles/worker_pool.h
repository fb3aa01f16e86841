// The threads that compute and read files, behind a queue of bounded length.
//
// Clients take turns, however many jobs one of them has waiting, and a client's own jobs go by their level and age. No
// client fills the queue: it may have twice as many jobs waiting as there are places left (dynamic thresholds:
// Choudhury and Hahne, IEEE/ACM Transactions on Networking 6(2), 1998), so that there is one for whoever comes next.
//
// Thread-safe. A job that was taken is run, also during shutdown; a job that finds no place is refused, so that the
// time a request waits is bounded by configuration and not by load.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <vector>

namespace terrace::server {

struct JobOrder {
  std::uint64_t client = 0;  // whose turn it takes; 0: nobody's in particular, which may fill the queue
  int level = 0;             // of the client's jobs a lower one goes first, if it comes soon after: shallow tiles
                             // cover what deep ones refine, but must not keep them waiting for ever
};

class WorkerPool {
 public:
  // `threads` 0 means as many as the machine has processors. `queue_length` counts the jobs that wait for a thread.
  WorkerPool(unsigned threads, std::size_t queue_length);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // False: there is no place in the queue or the pool is shut down, and `job` will not run. Jobs must not throw.
  [[nodiscard]] bool TrySubmit(std::function<void()> job, JobOrder order = {});

  // Takes no more jobs, runs those it has and joins the threads. May be called twice; not from a job.
  void Shutdown();

  std::size_t queued() const;
  unsigned threads() const { return thread_count_; }

 private:
  using Job = std::function<void()>;

  void Run();
  bool HasPlace(std::uint64_t client) const;  // mutex_ is held, as for the next one
  Job TakeNext();

  const unsigned thread_count_;
  const std::size_t queue_length_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  // Client -> when its jobs would have come if a level were an age -> jobs, oldest first; none is empty.
  std::map<std::uint64_t, std::multimap<std::chrono::steady_clock::time_point, Job>> queue_;
  std::size_t queued_ = 0;         // jobs in queue_
  std::uint64_t last_client_ = 0;  // whose job was taken last
  unsigned idle_ = 0;              // threads without a job
  bool shut_down_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace terrace::server

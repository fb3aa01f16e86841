// Threads that decode tiles.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace terrace::fly {

class WorkerPool {
 public:
  explicit WorkerPool(int threads);
  ~WorkerPool();  // drops jobs that have not begun, waits for the others
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  void Post(std::function<void()> job);  // thread-safe

 private:
  void Run();

  std::mutex mutex_;  // guards jobs_ and stops_
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool stops_ = false;
  std::vector<std::jthread> threads_;
};

}  // namespace terrace::fly

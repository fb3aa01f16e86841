// The threads for network I/O. Each has its own io_context: everything in a context runs on one thread, without strands
// or locks.
#pragma once

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <memory>
#include <thread>
#include <vector>

#include "server/asio/asio.h"

namespace terrace::server {

class IoThreads {
 public:
  // Precondition: `count` is at least 1.
  explicit IoThreads(unsigned count);
  ~IoThreads() { Stop(); }

  void Start();

  // Stops and joins all threads; pending work never runs. Do not call it from one of the threads.
  void Stop();

  asio::io_context& first() { return threads_.front()->io; }

  // Returns the contexts in turn. Thread-safe.
  asio::io_context& Next() { return threads_[turn_.fetch_add(1, std::memory_order_relaxed) % threads_.size()]->io; }

 private:
  struct Thread {
    asio::io_context io{1};
    asio::executor_work_guard<asio::io_context::executor_type> work{io.get_executor()};
    std::thread thread;
  };

  std::vector<std::unique_ptr<Thread>> threads_;
  std::atomic<std::size_t> turn_{0};
};

}  // namespace terrace::server

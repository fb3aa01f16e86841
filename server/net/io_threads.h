// The threads for network I/O. Each has its own io_context: everything in a context runs on one thread, without strands
// or locks.
#pragma once

#include <atomic>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <memory>
#include <thread>
#include <vector>

#include "server/asio.h"

namespace terrace::server {

class IoThreads {
 public:
  // Precondition: at least one.
  explicit IoThreads(unsigned count);
  ~IoThreads() { Stop(); }

  void Start();

  // Returns when every thread has ended; what still waits never runs. Not from one of the threads.
  void Stop();

  asio::io_context& first() { return threads_.front()->io; }

  // Takes turns. From any thread.
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

#include "server/net/io_threads.h"

#include <spdlog/spdlog.h>

#include <exception>

#include "engine/core/check.h"

namespace terrace::server {

namespace {

// Exceptions arrive here if memory is exhausted. They end one operation; the others continue.
void RunAll(asio::io_context& io) {
  for (;;) {
    try {
      io.run();
      return;
    } catch (const std::exception& exception) {
      spdlog::error("an I/O thread caught an exception and continues: {}", exception.what());
    }
  }
}

}  // namespace

IoThreads::IoThreads(unsigned count) {
  TERRACE_CHECK(count > 0);
  for (unsigned i = 0; i < count; ++i) threads_.push_back(std::make_unique<Thread>());
}

void IoThreads::Start() {
  for (const auto& thread : threads_) thread->thread = std::thread([&io = thread->io] { RunAll(io); });
}

void IoThreads::Stop() {
  for (const auto& thread : threads_) {
    thread->work.reset();
    thread->io.stop();
  }
  for (const auto& thread : threads_) {
    if (thread->thread.joinable()) thread->thread.join();
  }
}

}  // namespace terrace::server

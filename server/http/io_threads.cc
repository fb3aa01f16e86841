#include "server/http/io_threads.h"

#include "engine/core/check.h"

namespace terrace::server {

IoThreads::IoThreads(unsigned count) {
  TERRACE_CHECK(count > 0);
  for (unsigned i = 0; i < count; ++i) threads_.push_back(std::make_unique<Thread>());
}

void IoThreads::Start() {
  for (const auto& thread : threads_) thread->thread = std::thread([&io = thread->io] { io.run(); });
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

#include "server/cli/serve/stop_limit.h"

#include <spdlog/spdlog.h>

#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <stop_token>

#include "server/cli/common/command.h"

namespace terrace::cli {

void StopLimit::Begin(std::chrono::milliseconds limit) {
  thread_ = std::jthread([limit](const std::stop_token& stop) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any().wait_for(lock, stop, limit, [] { return false; });
    if (stop.stop_requested()) return;
    spdlog::error(
        "stopped: threads that still worked {} s after the signal were cut off; look whether a source can be read",
        std::chrono::duration<double>(limit).count());
    spdlog::default_logger()->flush();
    std::_Exit(kExitFailure);
  });
}

}  // namespace terrace::cli

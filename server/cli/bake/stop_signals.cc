#include "server/cli/bake/stop_signals.h"

#include <signal.h>

#include <cstdlib>

namespace terrace::cli {

StopSignals::StopSignals() {
  sigset_t set;
  ::sigemptyset(&set);
  ::sigaddset(&set, SIGINT);
  ::sigaddset(&set, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  thread_ = std::jthread([this, set](const std::stop_token& ended) {
    while (!ended.stop_requested()) {
      const int came = ::sigwaitinfo(&set, nullptr);
      if (came <= 0 || ended.stop_requested()) continue;
      if (signal_ != 0) std::_Exit(128 + came);
      signal_ = came;
      source_.request_stop();
    }
  });
}

StopSignals::~StopSignals() {
  thread_.request_stop();
  ::pthread_kill(thread_.native_handle(), SIGTERM);  // wakes the thread
}

}  // namespace terrace::cli

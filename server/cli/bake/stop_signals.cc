#include "server/cli/bake/stop_signals.h"

#include <signal.h>

#include <cstdlib>
#include <ctime>

namespace terrace::cli {

StopSignals::StopSignals() {
  sigset_t set;
  ::sigemptyset(&set);
  ::sigaddset(&set, SIGINT);
  ::sigaddset(&set, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  thread_ = std::jthread([this, set](const std::stop_token& ended) {
    constexpr timespec kPause{0, 100'000'000};
    while (!ended.stop_requested()) {
      const int came = ::sigtimedwait(&set, nullptr, &kPause);
      if (came <= 0) continue;
      if (signal_ != 0) std::_Exit(128 + came);
      signal_ = came;
      source_.request_stop();
    }
  });
}

}  // namespace terrace::cli

#include "server/cli/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace terrace::cli {

using Clock = std::chrono::steady_clock;

Progress::Progress(std::string what)
    : what_(std::move(what)), terminal_(isatty(STDERR_FILENO) != 0), start_(Clock::now()), last_(start_) {}

Progress::~Progress() {
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
}

void Progress::Update(double share) {
  share_ = std::max(share_, share);
  const Clock::time_point now = Clock::now();
  const auto pause = std::chrono::milliseconds(!terminal_ ? 10'000 : shown_ ? 100 : 1'000);
  if (now - last_ < pause) return;
  std::fprintf(stderr, terminal_ ? "\r\033[Kterrace: %s %.0f %%" : "terrace: %s %.0f %%\n", what_.c_str(),
               share_ * 100);
  std::fflush(stderr);
  shown_ = true;
  last_ = now;
}

std::function<void(double)> Progress::Callback() {
  return [this](double share) { Update(share); };
}

}  // namespace terrace::cli

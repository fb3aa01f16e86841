#include "server/cli/progress.h"

#include <unistd.h>

#include <cstdio>
#include <utility>

namespace terrace::cli {

using Clock = std::chrono::steady_clock;

Progress::Progress(std::string what)
    : what_(std::move(what)), terminal_(isatty(STDERR_FILENO) != 0), start_(Clock::now()) {}

Progress::~Progress() {
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
}

void Progress::Update(double share) {
  const Clock::time_point now = Clock::now();
  const auto pause = terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(10'000);
  if (now - start_ < std::chrono::seconds(1) || (shown_ && now - last_ < pause)) return;
  std::fprintf(stderr, terminal_ ? "\r\033[Kterrace: %s %.0f %%" : "terrace: %s %.0f %%\n", what_.c_str(), share * 100);
  std::fflush(stderr);
  shown_ = true;
  last_ = now;
}

std::function<void(double)> Progress::Callback() {
  return [this](double share) { Update(share); };
}

}  // namespace terrace::cli

#include "server/cli/common/progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

#include "engine/core/plain_number.h"

namespace terrace::cli {

using Clock = std::chrono::steady_clock;

Progress::Progress(std::string what, std::size_t count)
    : what_(std::move(what)),
      count_(count),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(Clock::now()),
      last_(start_) {}

Progress::~Progress() {
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
}

// Estimated from the pace since the first reported share, because work of an earlier run took no time in this one.
std::string Progress::TimeLeft(Clock::time_point now) const {
  const double seconds = std::chrono::duration<double>(now - start_).count();
  if (!(share_ > first_share_)) return {};
  const double left = seconds * (1 - share_) / (share_ - first_share_);
  if (left < 1) return {};
  if (left < 60) return ", " + std::to_string(std::lround(left)) + " s left";
  if (left < 90 * 60) return ", " + std::to_string(std::lround(left / 60)) + " min left";
  return ", " + std::to_string(std::lround(left / 3600)) + " h left";
}

void Progress::Update(double share) {
  if (share_ == 0) first_share_ = share;
  share_ = std::max(share_, share);
  const Clock::time_point now = Clock::now();
  const auto pause = std::chrono::milliseconds(!shown_ && !is_quiet_ ? 1'000 : terminal_ ? 100 : 10'000);
  if (now - last_ < pause) return;
  const std::string done =
      count_ > 1 ? Grouped(static_cast<std::size_t>(share_ * static_cast<double>(count_))) + " of " + Grouped(count_)
                 : std::to_string(std::lround(share_ * 100)) + " %";
  std::fprintf(stderr, terminal_ ? "\r\033[Kterrace: %s %s%s" : "terrace: %s %s%s\n", what_.c_str(), done.c_str(),
               TimeLeft(now).c_str());
  std::fflush(stderr);
  shown_ = true;
  last_ = now;
}

void Progress::UseLines() {
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
  terminal_ = false;
  is_quiet_ = true;
}

std::function<void(double)> Progress::Callback() {
  return [this](double share) { Update(share); };
}

}  // namespace terrace::cli

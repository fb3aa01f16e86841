#include "server/cli/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace terrace::cli {

using Clock = std::chrono::steady_clock;

Progress::Progress(std::string what)
    : what_(std::move(what)), terminal_(isatty(STDERR_FILENO) != 0), start_(Clock::now()), last_(start_) {}

Progress::~Progress() {
  if (shown_ && terminal_) std::fputs("\r\033[K", stderr);
}

// By the pace since the first share that was told: work that was done in an earlier run took no time in this one.
std::string Progress::TimeLeft(Clock::time_point now) const {
  const double seconds = std::chrono::duration<double>(now - start_).count();
  if (!(share_ > first_share_)) return {};
  const double left = seconds * (1 - share_) / (share_ - first_share_);
  if (left < 1) return {};
  const double minutes = std::round(left / 60), hours = std::round(left / 3600);
  if (left < 60) return fmt::format(", {:.0f} s left", left);
  return minutes < 90 ? fmt::format(", {:.0f} min left", minutes) : fmt::format(", {:.0f} h left", hours);
}

void Progress::Update(double share) {
  if (share_ == 0) first_share_ = share;
  share_ = std::max(share_, share);
  const Clock::time_point now = Clock::now();
  const auto pause = std::chrono::milliseconds(!terminal_ ? 10'000 : shown_ ? 100 : 1'000);
  if (now - last_ < pause) return;
  std::fprintf(stderr, terminal_ ? "\r\033[Kterrace: %s %.0f %%%s" : "terrace: %s %.0f %%%s\n", what_.c_str(),
               share_ * 100, TimeLeft(now).c_str());
  std::fflush(stderr);
  shown_ = true;
  last_ = now;
}

std::function<void(double)> Progress::Callback() {
  return [this](double share) { Update(share); };
}

}  // namespace terrace::cli

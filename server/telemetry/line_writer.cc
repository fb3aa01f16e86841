#include "server/telemetry/line_writer.h"

#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <string>
#include <utility>

namespace terrace::server {

LineWriter::LineWriter(int descriptor) : descriptor_(descriptor) {
  struct stat status {};
  takes_all_ = (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode)) || ::isatty(descriptor) != 0;
}

LineWriter& LineWriter::Stderr() {
  static LineWriter writer(STDERR_FILENO);
  return writer;
}

bool LineWriter::Write(std::string_view lines) {
  const std::lock_guard lock(mutex_);
  const bool is_whole = is_cut_ ? Put(std::string("\n").append(lines)) : Put(lines);
  missed_ += is_whole ? 0 : 1;
  return is_whole;
}

std::uint64_t LineWriter::TakeMissed() {
  const std::lock_guard lock(mutex_);
  return std::exchange(missed_, 0);
}

// A pipe with room at all takes PIPE_BUF bytes without waiting (pipe(7)).
bool LineWriter::Put(std::string_view text) {
  while (!text.empty()) {
    const std::string_view piece = takes_all_ ? text : text.substr(0, PIPE_BUF);
    const ssize_t written = IsReady() ? ::write(descriptor_, piece.data(), piece.size()) : -1;
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
    is_cut_ = !text.empty();
  }
  return true;
}

// Checked before writing, because the write may block: setting O_NONBLOCK would affect all processes that share the
// descriptor.
bool LineWriter::IsReady() {
  if (takes_all_) return true;
  const auto poll_for = [&](Clock::duration time) {
    pollfd waited{descriptor_, POLLOUT, 0};
    return ::poll(&waited, 1, static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(time).count()));
  };
  const auto now = Clock::now();
  patience_ = std::min(kPatience, patience_ + (now - asked_) / kShare);
  asked_ = now;
  int ready = poll_for(Clock::duration::zero());
  if (ready == 0 && patience_ >= std::chrono::milliseconds(1)) {
    ready = poll_for(patience_);
    asked_ = Clock::now();
    patience_ = std::max(patience_ - (asked_ - now), Clock::duration::zero());
  }
  if (ready == 0) errno = EAGAIN;
  return ready > 0;
}

}  // namespace terrace::server

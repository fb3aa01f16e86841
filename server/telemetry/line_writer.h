// Lines to a descriptor that somebody else reads, or does not: a log must not stop what it tells of.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string_view>

namespace terrace::server {

// Thread-safe. The descriptor stays the caller's.
class LineWriter {
 public:
  explicit LineWriter(int descriptor);

  // The one for the standard error stream: two would not know of each other what has just been written.
  static LineWriter& Stderr();

  // Lines, each with its end; up to PIPE_BUF bytes in one piece, as others may write to the same file or pipe. Readers
  // who are slow are waited for a second in all, and for a sixtieth of the time that goes by; only terminals as long as
  // it takes. False where something is missing, for whatever reason, such as a full disk; a line that was cut is ended
  // before the next one.
  bool Write(std::string_view lines);

  // How many calls of Write have failed since the last call of this.
  std::uint64_t TakeMissed();

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr Clock::duration kPatience = std::chrono::seconds(1);
  static constexpr int kShare = 60;

  bool Put(std::string_view text);
  bool IsReady();

  const int descriptor_;
  bool takes_all_ = false;  // a file, or a terminal
  std::mutex mutex_;
  Clock::duration patience_ = kPatience;  // guarded by mutex_: what of it is left
  Clock::time_point asked_;               // when that was so; likewise
  bool is_cut_ = false;                   // the last line was; likewise
  std::uint64_t missed_ = 0;              // likewise
};

}  // namespace terrace::server

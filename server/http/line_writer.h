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

  // Lines, each with its end; up to PIPE_BUF bytes in one piece, as others may write to the same file or pipe. A reader
  // that takes nothing for `kPatience` has stalled, and is not waited for again until it goes on. False where something
  // is missing, for whatever reason, such as a full disk; a line that was cut is ended before the next one.
  bool Write(std::string_view lines);

  // How many calls of Write have failed since the last call of this.
  std::uint64_t TakeMissed();

  static constexpr std::chrono::milliseconds kPatience{1000};

 private:
  bool Put(std::string_view text);
  bool IsReady();

  const int descriptor_;
  bool is_file_ = false;  // takes whatever it is given
  std::mutex mutex_;
  bool is_stalled_ = false;   // guarded by mutex_
  bool is_cut_ = false;       // the last line was; likewise
  std::uint64_t missed_ = 0;  // likewise
};

}  // namespace terrace::server

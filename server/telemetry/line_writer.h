// Writes log lines to a file descriptor; drops them when the reader stalls, so that a log never blocks the server.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string_view>

namespace terrace::server {

// Thread-safe. Does not own the descriptor.
class LineWriter {
 public:
  explicit LineWriter(int descriptor);

  // The only writer for the standard error stream. Two writers would not share their state.
  static LineWriter& Stderr();

  // Writes lines, each with its line feed; up to PIPE_BUF bytes in one write, because others may write to the same file
  // or pipe. Waits for slow readers for one second in total, plus a sixtieth of the elapsed time; waits for terminals
  // without a limit. Returns false if not everything was written, for example because the disk is full. An incomplete
  // line is ended before the next one.
  bool Write(std::string_view lines);

  // Returns the number of calls of Write that have failed since the last call of TakeMissed.
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
  Clock::duration patience_ = kPatience;  // guarded by mutex_: the remaining waiting time
  Clock::time_point asked_;               // when patience_ was updated; guarded by mutex_
  bool is_cut_ = false;                   // the last line is incomplete; guarded by mutex_
  std::uint64_t missed_ = 0;              // guarded by mutex_
};

}  // namespace terrace::server

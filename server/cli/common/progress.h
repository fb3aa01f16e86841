// Progress of work that takes longer than a second, as one line on stderr.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>

namespace terrace::cli {

// Prints "terrace: reading alps.tif 42 %, 3 min left", or "terrace: reading dems 1,234 of 5,000" for many items. On a
// terminal the line is rewritten in place; otherwise a line is printed after a second, and then every ten seconds.
// Prints nothing if the work takes less than a second.
class Progress {
 public:
  explicit Progress(std::string what, std::size_t count = 1);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Update(double share);  // 0 .. 1

  // From now on a line every ten seconds, also on a terminal and also for the first one: other lines are written
  // meanwhile.
  void UseLines();

  // For APIs that take a function; must not outlive this object.
  std::function<void(double)> Callback();

 private:
  // ", 12 s left"; empty as long as no estimate is possible.
  std::string TimeLeft(std::chrono::steady_clock::time_point now) const;

  const std::string what_;
  const std::size_t count_;
  bool terminal_;
  const std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_;
  double share_ = 0;  // never decreases
  double first_share_ = 0;
  bool shown_ = false;
  bool is_quiet_ = false;  // since UseLines
};

}  // namespace terrace::cli

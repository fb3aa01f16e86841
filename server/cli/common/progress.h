// Progress of work that takes longer than a second, as one line on stderr.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <string>

namespace terrace::cli {

// "terrace: reading alps.tif 42 %, 3 min left"; of many things "terrace: reading dems 1,234 of 5,000". On a terminal
// the line is rewritten in place, elsewhere a line comes every ten seconds. Says nothing about work that is over within
// a second.
class Progress {
 public:
  explicit Progress(std::string what, std::size_t count = 1);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Update(double share);  // 0 .. 1

  // For APIs that take a function; must not outlive this object.
  std::function<void(double)> Callback();

 private:
  // ", 12 s left"; empty while nothing can be said.
  std::string TimeLeft(std::chrono::steady_clock::time_point now) const;

  const std::string what_;
  const std::size_t count_;
  const bool terminal_;
  const std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_;
  double share_ = 0;  // never falls
  double first_share_ = 0;
  bool shown_ = false;
};

}  // namespace terrace::cli

// What a test's program asks for by operator new.
#pragma once

#include <atomic>
#include <cstddef>
#include <stop_token>

namespace terrace::server {

// Bytes that are held, and the most that were since a test set it back.
extern std::atomic<std::size_t> held_bytes, peak_bytes;

// Requests a stop in the middle of a job that asks for ever larger pieces of memory: at the first of `at_bytes` or
// more. Of one thread; one at a time.
class StopAtAllocation {
 public:
  explicit StopAtAllocation(std::size_t at_bytes);
  ~StopAtAllocation();
  StopAtAllocation(const StopAtAllocation&) = delete;
  StopAtAllocation& operator=(const StopAtAllocation&) = delete;

  std::stop_token token() const { return source_.get_token(); }
  bool happened() const { return source_.stop_requested(); }
  // What was asked for afterwards.
  std::size_t largest_after() const { return largest_after_; }

  void Note(std::size_t bytes);

 private:
  const std::size_t at_bytes_;
  std::stop_source source_;
  std::size_t largest_after_ = 0;
};

}  // namespace terrace::server

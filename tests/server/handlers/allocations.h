// Records the allocations of a test program by operator new.
#pragma once

#include <atomic>
#include <cstddef>
#include <stop_token>

namespace terrace::server {

// Bytes allocated now, and the peak since a test reset it.
extern std::atomic<std::size_t> held_bytes, peak_bytes;

// Requests a stop during a job that allocates larger and larger blocks: at the first block of `at_bytes` or more. For
// one thread, and one object at a time.
class StopAtAllocation {
 public:
  explicit StopAtAllocation(std::size_t at_bytes);
  ~StopAtAllocation();
  StopAtAllocation(const StopAtAllocation&) = delete;
  StopAtAllocation& operator=(const StopAtAllocation&) = delete;

  std::stop_token token() const { return source_.get_token(); }
  bool happened() const { return source_.stop_requested(); }
  // The largest block allocated after the stop.
  std::size_t largest_after() const { return largest_after_; }

  void Note(std::size_t bytes);

 private:
  const std::size_t at_bytes_;
  std::stop_source source_;
  std::size_t largest_after_ = 0;
};

}  // namespace terrace::server

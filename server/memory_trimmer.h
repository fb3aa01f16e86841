// Gives memory that is free back to the system, as long as the process works.
//
// The allocator keeps what builds have freed, most of it between what lives on. One build in Draco takes two buffers of
// up to four bytes for each value that a coordinate's step can have, 20 MB and more, and frees them; the next finds the
// hole broken by a tile that was put into the cache, and takes new memory. Without this the server's size climbs by
// such steps for hours. A thread of its own; a trim takes about a millisecond, and what is taken again about 5 ms for
// 20 MB.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

namespace terrace::server {

class MemoryTrimmer {
 public:
  // Trims once in every period in which the process has computed anything worth it. Does nothing where the C library
  // has no way to.
  explicit MemoryTrimmer(std::chrono::milliseconds period = std::chrono::seconds(3));
  ~MemoryTrimmer();
  MemoryTrimmer(const MemoryTrimmer&) = delete;
  MemoryTrimmer& operator=(const MemoryTrimmer&) = delete;

 private:
  void Run(std::chrono::milliseconds period);

  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace terrace::server

// Returns free memory to the system, regularly while the process computes.
//
// The allocator keeps the memory that builds have freed, most of it between blocks that are still in use. One build
// with Draco uses two buffers of up to four bytes per possible step of a coordinate, 20 MB and more, and frees them.
// The next build finds this gap split by a tile that was cached in between, and takes new memory. Without trimming, the
// server would grow in such steps for hours. Trimming runs on its own thread and takes about a millisecond; taking 20
// MB again costs about 5 ms.
#pragma once

#include <chrono>
#include <thread>

namespace terrace::server {

class MemoryTrimmer {
 public:
  // Trims at most once per period, if the process has done enough computing in it. Does nothing if the C library has no
  // function for it.
  explicit MemoryTrimmer(std::chrono::milliseconds period = std::chrono::seconds(3));

 private:
  std::jthread thread_;
};

}  // namespace terrace::server

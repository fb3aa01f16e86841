// Bounds how long the process takes to stop. Jobs end when they ask their stop token, but a read of a source on a dead
// mount never returns, and neither joining its thread nor opening a source anew can be given up.
#pragma once

#include <chrono>
#include <thread>

namespace terrace::cli {

class StopLimit {
 public:
  // From now on the process may go on for `limit`; then it ends with status 1, whatever its threads do. Once.
  void Begin(std::chrono::milliseconds limit);

 private:
  std::jthread thread_;  // ends with this object
};

}  // namespace terrace::cli

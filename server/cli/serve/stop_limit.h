// Limits the time that the process takes to stop. Jobs check their stop tokens, but a read from a dead mount never
// returns, and its thread cannot be joined.
#pragma once

#include <chrono>
#include <thread>

namespace terrace::cli {

class StopLimit {
 public:
  // Ends the process with status 1 after `limit`, whatever its threads do. Call once.
  void Begin(std::chrono::milliseconds limit);

 private:
  std::jthread thread_;  // ends with this object
};

}  // namespace terrace::cli

// Runs work in parallel.
#pragma once

#include <cstddef>
#include <functional>

namespace terrace::dem {

// Calls work(0), work(1) .. work(count - 1) on `threads` threads, including this one; 0: as many as there are cores.
// Calls begin in this order; after one returns false, no other begins. Returns when all calls that began have ended,
// and rethrows the first exception. If threads cannot be created, uses fewer.
void ParallelFor(std::size_t count, const std::function<bool(std::size_t)>& work, std::size_t threads = 0);

}  // namespace terrace::dem

// Work on many things at once.
#pragma once

#include <cstddef>
#include <functional>

namespace terrace::dem {

// Calls work(0), work(1) .. work(count - 1) on as many threads as there are cores, this one among them. They begin in
// that order; once one has given false no other begins. Returns when all that began have ended, and throws what the
// first of them threw. Threads that cannot be had are done without.
void ForEachOnAllCores(std::size_t count, const std::function<bool(std::size_t)>& work);

}  // namespace terrace::dem

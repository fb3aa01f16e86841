#include "engine/common/parallel_for.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace terrace::dem {

void ParallelFor(std::size_t count, const std::function<bool(std::size_t)>& work, std::size_t threads) {
  std::mutex mutex;  // guards what follows
  std::size_t next = 0, thrower = 0;
  std::exception_ptr thrown;  // what work(thrower) threw
  const auto take = [&](bool goes_on) {
    const std::lock_guard lock(mutex);
    if (!goes_on) next = count;
    return next < count ? next++ : count;
  };
  const auto run = [&]() noexcept {
    for (std::size_t i = take(true); i < count;) {
      bool goes_on = false;
      try {
        goes_on = work(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (thrown == nullptr || i < thrower) thrown = std::current_exception(), thrower = i;
      }
      i = take(goes_on);
    }
  };
  std::vector<std::jthread> others;
  if (threads == 0) threads = std::max(1U, std::thread::hardware_concurrency());
  try {
    others.reserve(std::min(threads, count));
    while (others.size() + 1 < std::min(threads, count)) others.emplace_back(run);
  } catch (const std::system_error&) {
    // If a thread cannot be created, the existing ones do the work.
  }
  run();
  others.clear();
  if (thrown != nullptr) std::rethrow_exception(thrown);
}

}  // namespace terrace::dem

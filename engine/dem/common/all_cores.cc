#include "engine/dem/common/all_cores.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace terrace::dem {
namespace {

class Queue {
 public:
  Queue(std::size_t count, const std::function<bool(std::size_t)>& work) : count_(count), work_(work) {}

  void Run() noexcept {
    for (std::size_t i = Take(true); i < count_;) {
      bool goes_on = false;
      try {
        goes_on = work_(i);
      } catch (...) {
        const std::lock_guard lock(mutex_);
        if (thrown_ == nullptr || i < thrower_) {
          thrown_ = std::current_exception();
          thrower_ = i;
        }
      }
      i = Take(goes_on);
    }
  }

  void Rethrow() const {
    if (thrown_ != nullptr) std::rethrow_exception(thrown_);
  }

 private:
  std::size_t Take(bool goes_on) {
    const std::lock_guard lock(mutex_);
    if (!goes_on) next_ = count_;
    return next_ < count_ ? next_++ : count_;
  }

  const std::size_t count_;
  const std::function<bool(std::size_t)>& work_;
  std::mutex mutex_;
  std::size_t next_ = 0;  // guarded by mutex_, as are these
  std::size_t thrower_ = 0;
  std::exception_ptr thrown_;  // exception of work(thrower_)
};

}  // namespace

void ForEachOnAllCores(std::size_t count, const std::function<bool(std::size_t)>& work) {
  Queue queue(count, work);
  std::vector<std::jthread> threads;
  const std::size_t cores = std::max(1U, std::thread::hardware_concurrency());
  try {
    threads.reserve(cores);
    while (threads.size() + 1 < std::min(cores, count)) threads.emplace_back([&queue] { queue.Run(); });
  } catch (const std::system_error&) {
    // If a thread cannot be created, the existing ones do the work.
  }
  queue.Run();
  threads.clear();
  queue.Rethrow();
}

}  // namespace terrace::dem

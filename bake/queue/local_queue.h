// The queue of a baker that works alone, or on one shard.
#pragma once

#include <cstddef>
#include <deque>
#include <mutex>
#include <vector>

#include "bake/queue/unit_queue.h"

namespace terrace::bake {

// The units 0 .. count - 1 in this order. Failed units are handed out again at the end.
class LocalQueue : public UnitQueue {
 public:
  explicit LocalQueue(std::size_t count);

  Taken Take() override;
  void Done(std::size_t unit) override;
  void Return(std::size_t unit) override;
  bool Fail(std::size_t unit, const Error& why) override;

 private:
  std::mutex mutex_;
  std::deque<std::size_t> pending_;
  std::vector<int> attempts_;  // that failed, by unit
  std::size_t taken_ = 0;      // units that were taken and not given back
};

}  // namespace terrace::bake

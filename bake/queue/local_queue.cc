#include "bake/queue/local_queue.h"

namespace terrace::bake {

LocalQueue::LocalQueue(std::size_t count) : attempts_(count) {
  for (std::size_t i = 0; i < count; ++i) pending_.push_back(i);
}

UnitQueue::Taken LocalQueue::Take() {
  const std::lock_guard lock(mutex_);
  if (pending_.empty()) return {taken_ > 0 ? Taken::State::kWait : Taken::State::kOver};
  const std::size_t unit = pending_.front();
  pending_.pop_front();
  ++taken_;
  return {Taken::State::kUnit, unit, attempts_[unit]};
}

void LocalQueue::Done(std::size_t) {
  const std::lock_guard lock(mutex_);
  --taken_;
}

void LocalQueue::Return(std::size_t unit) {
  const std::lock_guard lock(mutex_);
  --taken_;
  pending_.push_front(unit);
}

bool LocalQueue::Fail(std::size_t unit, const Error& why) {
  const std::lock_guard lock(mutex_);
  --taken_;
  // A changed file stays changed for this process: it fails a second time.
  const int limit = why.code == ErrorCode::kChanged ? kMaxAttempts - 1 : kMaxAttempts;
  if (++attempts_[unit] >= limit) return false;
  pending_.push_back(unit);
  return true;
}

}  // namespace terrace::bake

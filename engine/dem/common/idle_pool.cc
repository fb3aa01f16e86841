#include "engine/dem/common/idle_pool.h"

#include <iterator>
#include <list>
#include <mutex>
#include <new>
#include <unordered_map>
#include <vector>

namespace terrace::dem {

class IdleList {
 public:
  // Never destroyed, because pools of static lifetime may be destroyed later.
  static IdleList& OfProcess() {
    static IdleList& list = *new IdleList;
    return list;
  }

  void SetLimit(std::size_t count) {
    Items gone;  // closed after the lock is released, here and below: closing a file may take long
    const std::lock_guard lock(mutex_);
    limit_ = count;
    Shrink(gone);
  }

  AnyIdlePool::Lease Take(const AnyIdlePool& pool) {
    const std::lock_guard lock(mutex_);
    const auto of_pool = by_pool_.find(&pool);
    if (of_pool == by_pool_.end() || of_pool->second.empty()) return {nullptr, pool.epoch_};
    const Items::iterator last_used = of_pool->second.back();
    AnyIdlePool::Lease lease{std::move(last_used->item), pool.epoch_};
    items_.erase(last_used);
    of_pool->second.pop_back();
    return lease;
  }

  void Keep(const AnyIdlePool& pool, AnyIdlePool::Lease lease) {
    Items gone, added;
    added.push_back({&pool, std::move(lease.item)});
    const std::lock_guard lock(mutex_);
    if (lease.epoch != pool.epoch_) return;
    by_pool_[&pool].push_back(added.begin());
    items_.splice(items_.begin(), added);
    Shrink(gone);
  }

  void Clear(AnyIdlePool& pool) {
    Items gone;
    const std::lock_guard lock(mutex_);
    ++pool.epoch_;
    const auto of_pool = by_pool_.find(&pool);
    if (of_pool == by_pool_.end()) return;
    for (const Items::iterator item : of_pool->second) gone.splice(gone.end(), items_, item);
    by_pool_.erase(of_pool);
  }

 private:
  struct Item {
    const AnyIdlePool* pool;
    std::shared_ptr<void> item;
  };
  using Items = std::list<Item>;

  void Shrink(Items& gone) {
    while (items_.size() > limit_) {
      const auto of_pool = by_pool_.find(items_.back().pool);
      of_pool->second.erase(of_pool->second.begin());  // least recently used first, also within a pool
      gone.splice(gone.end(), items_, std::prev(items_.end()));
    }
  }

  std::mutex mutex_;  // guards what follows, and the pools' epochs
  std::size_t limit_ = 256;
  Items items_;  // most recently used first
  std::unordered_map<const AnyIdlePool*, std::vector<Items::iterator>> by_pool_;
};

void SetMostIdle(std::size_t count) { IdleList::OfProcess().SetLimit(count); }

void AnyIdlePool::Clear() noexcept { IdleList::OfProcess().Clear(*this); }

AnyIdlePool::Lease AnyIdlePool::TakeAny() { return IdleList::OfProcess().Take(*this); }

void AnyIdlePool::KeepAny(Lease lease) noexcept {
  try {
    IdleList::OfProcess().Keep(*this, std::move(lease));
  } catch (const std::bad_alloc&) {
    // The object is closed, and opened again when needed.
  }
}

}  // namespace terrace::dem

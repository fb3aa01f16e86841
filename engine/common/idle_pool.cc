#include "engine/common/idle_pool.h"

#include <iterator>
#include <list>
#include <mutex>
#include <new>
#include <unordered_map>
#include <vector>

namespace terrace::dem {

namespace {

struct Item {
  const AnyIdlePool* pool;
  std::shared_ptr<void> item;
};
using Items = std::list<Item>;

// What all pools keep.
struct IdleList {
  std::mutex mutex;  // guards what follows, and the pools' epochs
  std::size_t limit = 256;
  Items items;  // most recently used first
  std::unordered_map<const AnyIdlePool*, std::vector<Items::iterator>> by_pool;

  void Shrink(Items& gone) {
    while (items.size() > limit) {
      const auto of_pool = by_pool.find(items.back().pool);
      of_pool->second.erase(of_pool->second.begin());  // least recently used first, also within a pool
      gone.splice(gone.end(), items, std::prev(items.end()));
    }
  }
};

// Never destroyed, because pools of static lifetime may be destroyed later.
IdleList& OfProcess() {
  static IdleList& list = *new IdleList;
  return list;
}

}  // namespace

void SetMaxIdle(std::size_t count) {
  Items gone;  // closed after the lock is released, here and below: closing a file may take long
  IdleList& list = OfProcess();
  const std::lock_guard lock(list.mutex);
  list.limit = count;
  list.Shrink(gone);
}

void AnyIdlePool::Clear() noexcept {
  Items gone;
  IdleList& list = OfProcess();
  const std::lock_guard lock(list.mutex);
  ++epoch_;
  const auto of_pool = list.by_pool.find(this);
  if (of_pool == list.by_pool.end()) return;
  for (const Items::iterator item : of_pool->second) gone.splice(gone.end(), list.items, item);
  list.by_pool.erase(of_pool);
}

AnyIdlePool::Lease AnyIdlePool::TakeAny() {
  IdleList& list = OfProcess();
  const std::lock_guard lock(list.mutex);
  const auto of_pool = list.by_pool.find(this);
  if (of_pool == list.by_pool.end() || of_pool->second.empty()) return {nullptr, epoch_};
  const Items::iterator last_used = of_pool->second.back();
  Lease lease{std::move(last_used->item), epoch_};
  list.items.erase(last_used);
  of_pool->second.pop_back();
  return lease;
}

void AnyIdlePool::KeepAny(Lease lease) noexcept {
  Items gone, added;
  try {
    added.push_back({this, std::move(lease.item)});
    IdleList& list = OfProcess();
    const std::lock_guard lock(list.mutex);
    if (lease.epoch != epoch_) return;
    list.by_pool[this].push_back(added.begin());
    list.items.splice(list.items.begin(), added);
    list.Shrink(gone);
  } catch (const std::bad_alloc&) {
    // The object is closed, and opened again when needed.
  }
}

}  // namespace terrace::dem

// A pool that keeps unused file handles open: GDAL datasets, images, PROJ operations with their grids.
//
// Each object is used by one thread at a time and returns to its pool. All pools of the process share one list with a
// limit: the objects unused for longest are closed, whichever pool they belong to. Objects in use do not count; the
// number of threads bounds them. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

namespace terrace::dem {

// Sets the limit of idle objects in all pools of the process. The default is 256.
void SetMostIdle(std::size_t count);

class AnyIdlePool {
 public:
  AnyIdlePool() = default;
  AnyIdlePool(const AnyIdlePool&) = delete;
  AnyIdlePool& operator=(const AnyIdlePool&) = delete;
  ~AnyIdlePool() { Clear(); }

  // Closes all idle objects, and objects in use when they are returned.
  void Clear() noexcept;

 protected:
  struct Lease {
    std::shared_ptr<void> item;
    std::uint64_t epoch = 0;
  };
  Lease TakeAny();
  // Closes the object if there is no memory to keep it.
  void KeepAny(Lease lease) noexcept;

 private:
  friend class IdleList;
  std::uint64_t epoch_ = 0;  // counts calls of Clear; guarded by the list's mutex
};

template <typename T>
class IdlePool : public AnyIdlePool {
 public:
  // An object from the pool, or one that the caller made instead. `epoch`: detects calls of Clear since then.
  struct Taken {
    std::shared_ptr<T> item;
    std::uint64_t epoch = 0;
  };

  // Takes the most recently used object. Null: none is idle; the caller makes one.
  Taken Take() {
    Lease lease = TakeAny();
    return {std::static_pointer_cast<T>(std::move(lease.item)), lease.epoch};
  }
  void Keep(Taken taken) noexcept { KeepAny({std::move(taken.item), taken.epoch}); }
};

}  // namespace terrace::dem

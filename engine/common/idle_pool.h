// A pool that keeps unused file handles open: GDAL datasets, images, PROJ operations with their grids, units of
// archives.
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
void SetMaxIdle(std::size_t count);

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
  std::uint64_t epoch_ = 0;  // counts calls of Clear; guarded by the mutex of the process's list
};

template <typename T>
class IdlePool : public AnyIdlePool {
 public:
  // An object on loan. Its destructor returns the object to the pool, which must outlive it.
  class Handle {
   public:
    Handle(IdlePool& pool, Lease lease)
        : pool_(&pool), item_(std::static_pointer_cast<T>(std::move(lease.item))), epoch_(lease.epoch) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = delete;
    ~Handle() {
      if (item_ != nullptr) pool_->KeepAny({std::move(item_), epoch_});
    }
    explicit operator bool() const { return item_ != nullptr; }
    void Set(std::shared_ptr<T> item) { item_ = std::move(item); }
    T& operator*() const { return *item_; }
    T* operator->() const { return item_.get(); }

   private:
    IdlePool* pool_;
    std::shared_ptr<T> item_;
    std::uint64_t epoch_;  // detects calls of Clear since then
  };

  // Takes the most recently used object. False: none is idle, and the caller makes one (Set).
  Handle Take() { return Handle(*this, TakeAny()); }
};

}  // namespace terrace::dem

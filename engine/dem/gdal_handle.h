// GDAL datasets for many threads: each is used by one thread at a time.
//
// A GDALDataset shared by threads crashes; one per thread does not. A pool keeps as many as were ever in use at once,
// unless it shares a limit with others.
#pragma once

#include <gdal_priv.h>

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/file_stamp.h"

namespace terrace::dem {

class HandlePool;

// The open datasets that several pools keep for later: at most so many, those used longest ago are closed. What is in
// use counts not: no more than there are threads. Thread-safe.
class HandleLimit {
 public:
  explicit HandleLimit(std::size_t most_idle) : most_idle_(most_idle) {}

  // Null when the pool has none here.
  GDALDatasetUniquePtr Take(const HandlePool& pool);
  void Keep(const HandlePool& pool, GDALDatasetUniquePtr dataset);
  void Forget(const HandlePool& pool);
  std::size_t idle() const;

 private:
  struct Idle {
    const HandlePool* pool;
    GDALDatasetUniquePtr dataset;
  };
  const std::size_t most_idle_;
  mutable std::mutex mutex_;
  std::list<Idle> idle_;  // guarded by mutex_; the one used last comes first
};

// Thread-safe.
class HandlePool {
 public:
  // A dataset that belongs to the holder until it goes out of scope.
  class Handle {
   public:
    Handle(HandlePool& pool, GDALDatasetUniquePtr dataset, std::uint64_t epoch)
        : pool_(&pool), dataset_(std::move(dataset)), epoch_(epoch) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = delete;
    ~Handle() {
      if (dataset_ != nullptr) pool_->Return(std::move(dataset_), epoch_);
    }
    GDALDataset& operator*() const { return *dataset_; }
    GDALDataset* operator->() const { return dataset_.get(); }

   private:
    HandlePool* pool_;
    GDALDatasetUniquePtr dataset_;
    std::uint64_t epoch_;
  };

  // Without a limit of others it keeps all that it ever needed.
  HandlePool(std::string path, StampedFiles files, std::shared_ptr<HandleLimit> limit = nullptr);
  ~HandlePool() { limit_->Forget(*this); }

  // kChanged: a file of the raster is gone or was replaced. kUnavailable: it cannot be opened.
  Result<Handle> Borrow();

  // Whether the files are still the ones that were opened; asked again after a read, as they may be overwritten
  // meanwhile.
  Result<void> CheckUnchanged();

  const StampedFiles& files() const { return files_; }

 private:
  void Return(GDALDatasetUniquePtr dataset, std::uint64_t epoch);

  const std::string path_;
  const StampedFiles files_;
  const std::shared_ptr<HandleLimit> limit_;
  std::mutex mutex_;
  // Counts how often files were found changed; guarded by mutex_. A dataset that was opened before may hold another
  // file than the stamps tell of, should the old one come back: none is kept past such a moment.
  std::uint64_t epoch_ = 0;
};

}  // namespace terrace::dem

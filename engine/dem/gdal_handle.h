// GDAL datasets for many threads: each is used by one thread at a time.
//
// A GDALDataset shared by threads crashes; one per thread does not. The pool keeps as many as were ever in use at once.
#pragma once

#include <gdal_priv.h>

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/file_stamp.h"

namespace terrace::dem {

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

  HandlePool(std::string path, StampedFiles files) : path_(std::move(path)), files_(std::move(files)) {}

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
  std::mutex mutex_;
  std::vector<GDALDatasetUniquePtr> idle_;  // guarded by mutex_
  // Counts how often files were found changed; guarded by mutex_. A dataset that was opened before may hold another
  // file than the stamps tell of, should the old one come back: none is kept past such a moment.
  std::uint64_t epoch_ = 0;
};

}  // namespace terrace::dem

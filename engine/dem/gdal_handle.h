// GDAL datasets for many threads: each is used by one thread at a time.
//
// A GDALDataset shared by threads crashes; one per thread does not. The pool keeps as many as were ever in use at once.
#pragma once

#include <gdal_priv.h>

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
    Handle(HandlePool& pool, GDALDatasetUniquePtr dataset) : pool_(&pool), dataset_(std::move(dataset)) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = delete;
    ~Handle() {
      if (dataset_ != nullptr) pool_->Return(std::move(dataset_));
    }
    GDALDataset& operator*() const { return *dataset_; }
    GDALDataset* operator->() const { return dataset_.get(); }

   private:
    HandlePool* pool_;
    GDALDatasetUniquePtr dataset_;
  };

  HandlePool(std::string path, StampedFiles files) : path_(std::move(path)), files_(std::move(files)) {}

  // kUnavailable: a file of the raster is gone, was replaced or cannot be opened.
  Result<Handle> Borrow();

  // Whether the files are still the ones that were opened; asked again after a read, as they may be overwritten
  // meanwhile.
  Result<void> CheckUnchanged() const;

  const StampedFiles& files() const { return files_; }

 private:
  void Return(GDALDatasetUniquePtr dataset);

  const std::string path_;
  const StampedFiles files_;
  std::mutex mutex_;
  std::vector<GDALDatasetUniquePtr> idle_;  // guarded by mutex_
};

}  // namespace terrace::dem

// GDAL datasets of one raster for many threads: each is used by one thread at a time.
//
// A GDALDataset must not be shared by threads; with one per thread there is no conflict. Unused datasets are kept as
// described in IdlePool.
#pragma once

#include <gdal_priv.h>

#include <memory>
#include <string>
#include <utility>

#include "engine/core/result.h"
#include "engine/dem/common/idle_pool.h"
#include "engine/dem/gdal/file_stamp.h"

namespace terrace::dem {

// Thread-safe.
class HandlePool {
 public:
  // A dataset that belongs to the holder until it goes out of scope.
  class Handle {
   public:
    Handle(IdlePool<GDALDataset>& pool, IdlePool<GDALDataset>::Taken dataset)
        : pool_(&pool), dataset_(std::move(dataset)) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = delete;
    ~Handle() {
      if (dataset_.item != nullptr) pool_->Keep(std::move(dataset_));
    }
    GDALDataset& operator*() const { return *dataset_.item; }
    GDALDataset* operator->() const { return dataset_.item.get(); }

   private:
    IdlePool<GDALDataset>* pool_;
    IdlePool<GDALDataset>::Taken dataset_;
  };

  HandlePool(std::string path, StampedFiles files) : path_(std::move(path)), files_(std::move(files)) {}

  // kChanged: a file of the raster is gone or was replaced. kUnavailable: it cannot be opened.
  Result<Handle> Borrow();

  // Whether the files are still the ones that were opened. Ask again after a read, because files may be overwritten
  // during it. If they are not, no dataset that is open now is used again: it may hold another file than the stamps
  // describe, should the old file come back.
  Result<void> CheckUnchanged();

  const StampedFiles& files() const { return files_; }

 private:
  const std::string path_;
  const StampedFiles files_;
  IdlePool<GDALDataset> idle_;
};

}  // namespace terrace::dem

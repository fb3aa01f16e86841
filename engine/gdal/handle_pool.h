// GDAL datasets of one raster for many threads: each is used by one thread at a time.
//
// A GDALDataset must not be shared by threads; with one per thread there is no conflict. Unused datasets are kept as
// described in IdlePool.
#pragma once

#include <gdal_priv.h>

#include <string>
#include <utility>

#include "engine/common/idle_pool.h"
#include "engine/core/result.h"
#include "engine/gdal/stamped_files.h"

namespace terrace::dem {

// Thread-safe.
class HandlePool {
 public:
  HandlePool(std::string path, StampedFiles files) : path_(std::move(path)), files_(std::move(files)) {}

  // kChanged: a file of the raster is gone or was replaced. kUnavailable: it cannot be opened.
  Result<IdlePool<GDALDataset>::Handle> Borrow();

  // Checks that the files are still the ones that were opened. Check again after a read, because files may be
  // overwritten during it. If a file has changed, no dataset that is open now is used again, even if the old file comes
  // back: it may hold the content of another file.
  Result<void> CheckUnchanged();

  const StampedFiles& files() const { return files_; }

 private:
  const std::string path_;
  const StampedFiles files_;
  IdlePool<GDALDataset> idle_;
};

}  // namespace terrace::dem

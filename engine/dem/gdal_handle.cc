#include "engine/dem/gdal_handle.h"

#include <utility>

#include "engine/dem/gdal_runtime.h"
#include "engine/dem/raster_file.h"

namespace terrace::dem {

Result<HandlePool::Handle> HandlePool::Borrow() {
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  std::uint64_t epoch = 0;
  {
    const std::lock_guard lock(mutex_);
    epoch = epoch_;
    if (!idle_.empty()) {
      Handle handle(*this, std::move(idle_.back()), epoch);
      idle_.pop_back();
      return handle;
    }
  }
  GDALDatasetUniquePtr dataset = ReopenRaster(path_);
  if (dataset == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be opened any more ({}); restore the file", path_,
                     TakeGdalError());
  }
  // It may have been replaced between the look at it and the opening.
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  return Handle(*this, std::move(dataset), epoch);
}

Result<void> HandlePool::CheckUnchanged() {
  Result<void> unchanged = files_.CheckUnchanged(path_);
  if (!unchanged) {
    const std::lock_guard lock(mutex_);
    ++epoch_;
    idle_.clear();
  }
  return unchanged;
}

void HandlePool::Return(GDALDatasetUniquePtr dataset, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  if (epoch == epoch_) idle_.push_back(std::move(dataset));
}

}  // namespace terrace::dem

#include "engine/dem/gdal_handle.h"

#include <utility>

#include "engine/dem/gdal_runtime.h"
#include "engine/dem/raster_file.h"

namespace terrace::dem {

Result<HandlePool::Handle> HandlePool::Borrow() {
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  {
    const std::lock_guard lock(mutex_);
    if (!idle_.empty()) {
      Handle handle(*this, std::move(idle_.back()));
      idle_.pop_back();
      return handle;
    }
  }
  GDALDatasetUniquePtr dataset = ReopenRaster(path_);
  if (dataset == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be opened any more ({}); restore the file", path_,
                     TakeGdalError());
  }
  return Handle(*this, std::move(dataset));
}

Result<void> HandlePool::CheckUnchanged() const {
  if (const auto changed = files_.FirstChanged()) {
    return MakeError(ErrorCode::kUnavailable,
                     "{}: {} was changed, replaced or removed since it was opened; load the dataset anew", path_,
                     *changed == path_ ? "the file" : *changed);
  }
  return {};
}

void HandlePool::Return(GDALDatasetUniquePtr dataset) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(dataset));
}

}  // namespace terrace::dem

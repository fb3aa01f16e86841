#include "engine/gdal/handle_pool.h"

#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"

namespace terrace::dem {

Result<IdlePool<GDALDataset>::Handle> HandlePool::Borrow() {
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  IdlePool<GDALDataset>::Handle dataset = idle_.Take();
  if (dataset) return dataset;
  dataset.Set(ReopenRaster(path_));
  const std::string why = dataset ? "" : TakeGdalError();
  // The file may have been replaced or removed between the check and the opening, which may have failed for this
  // reason.
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (!dataset) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be opened any more ({}); restore the file", path_, why);
  }
  return dataset;
}

Result<void> HandlePool::CheckUnchanged() {
  Result<void> unchanged = files_.CheckUnchanged(path_);
  if (!unchanged) idle_.Clear();
  return unchanged;
}

}  // namespace terrace::dem

#include "engine/dem/gdal_handle.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <new>
#include <utility>

#include "engine/dem/gdal_runtime.h"
#include "engine/dem/raster_file.h"

namespace terrace::dem {

GDALDatasetUniquePtr HandleLimit::Take(const HandlePool& pool) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find(idle_, &pool, &Idle::pool);
  if (found == idle_.end()) return nullptr;
  GDALDatasetUniquePtr dataset = std::move(found->dataset);
  idle_.erase(found);
  return dataset;
}

void HandleLimit::Keep(const HandlePool& pool, GDALDatasetUniquePtr dataset) {
  std::list<Idle> closed;  // outside the lock
  const std::lock_guard lock(mutex_);
  idle_.push_front({&pool, std::move(dataset)});
  while (idle_.size() > most_idle_) closed.splice(closed.end(), idle_, std::prev(idle_.end()));
}

void HandleLimit::Forget(const HandlePool& pool) {
  const std::lock_guard lock(mutex_);
  std::erase_if(idle_, [&](const Idle& idle) { return idle.pool == &pool; });
}

std::size_t HandleLimit::idle() const {
  const std::lock_guard lock(mutex_);
  return idle_.size();
}

HandlePool::HandlePool(std::string path, StampedFiles files, std::shared_ptr<HandleLimit> limit)
    : path_(std::move(path)),
      files_(std::move(files)),
      limit_(limit != nullptr ? std::move(limit)
                              : std::make_shared<HandleLimit>(std::numeric_limits<std::size_t>::max())) {}

Result<HandlePool::Handle> HandlePool::Borrow() {
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  std::uint64_t epoch = 0;
  {
    const std::lock_guard lock(mutex_);
    epoch = epoch_;
    if (GDALDatasetUniquePtr idle = limit_->Take(*this)) return Handle(*this, std::move(idle), epoch);
  }
  GDALDatasetUniquePtr dataset = ReopenRaster(path_);
  const std::string why = dataset == nullptr ? TakeGdalError() : "";
  // It may have been replaced or removed between the look at it and the opening, which may have failed for that.
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (dataset == nullptr) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be opened any more ({}); restore the file", path_, why);
  }
  return Handle(*this, std::move(dataset), epoch);
}

Result<void> HandlePool::CheckUnchanged() {
  Result<void> unchanged = files_.CheckUnchanged(path_);
  if (!unchanged) {
    const std::lock_guard lock(mutex_);
    ++epoch_;
    limit_->Forget(*this);
  }
  return unchanged;
}

void HandlePool::Return(GDALDatasetUniquePtr dataset, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  if (epoch != epoch_) return;
  try {
    limit_->Keep(*this, std::move(dataset));
  } catch (const std::bad_alloc&) {
    // It is closed, and opened anew when it is wanted.
  }
}

}  // namespace terrace::dem

#include "engine/dem/image_pool.h"

#include <algorithm>
#include <new>
#include <utility>

#include "engine/dem/image_bins.h"
#include "engine/dem/overview_axis.h"
#include "engine/dem/raster_file.h"
#include "engine/dem/sample_grid.h"

namespace terrace::dem {

ImagePool::ImagePool(ImageFile image, StampedFiles files) : path_(image.path()), files_(std::move(files)) {
  GDALRasterBand& band = *image.dataset().GetRasterBand(1);
  sizes_.push_back({});
  for (const int factor : OverviewFactors(band)) {
    GDALRasterBand* const wanted = FindOverview(band, factor);
    for (int i = 0; i < band.GetOverviewCount(); ++i) {
      if (band.GetOverview(i) != wanted) continue;
      sizes_.push_back({factor, i, PixelsPerSample(image.dataset(), factor, image.width(), wanted->GetXSize()),
                        PixelsPerSample(image.dataset(), factor, image.height(), wanted->GetYSize())});
      break;
    }
  }
  idle_.resize(sizes_.size());
  idle_[0].push_back(std::move(image));
}

ImagePool::ImagePool(ImagePool&& other) noexcept
    : path_(std::move(other.path_)),
      files_(std::move(other.files_)),
      sizes_(std::move(other.sizes_)),
      idle_(std::move(other.idle_)) {}

int ImagePool::MostAveraged() const { return sizes_.back().factor * ImageBins::kMostPixels; }

Result<ImagePool::Handle> ImagePool::Borrow(int factor) {
  std::size_t size = 0;
  while (size + 1 < sizes_.size() && sizes_[size + 1].factor <= factor) ++size;
  std::uint64_t epoch = 0;
  {
    const std::lock_guard lock(mutex_);
    epoch = epoch_;
    if (std::vector<ImageFile>& idle = idle_[size]; !idle.empty()) {
      Handle handle(*this, size, std::move(idle.back()), epoch);
      idle.pop_back();
      return handle;
    }
  }
  auto image = ImageFile::Open(path_, sizes_[size].overview);
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (!image) return MakeError(ErrorCode::kUnavailable, "{}", image.error().message);
  return Handle(*this, size, *std::move(image), epoch);
}

Result<void> ImagePool::CheckUnchanged() {
  Result<void> unchanged = files_.CheckUnchanged(path_);
  if (!unchanged) {
    const std::lock_guard lock(mutex_);
    ++epoch_;
    for (std::vector<ImageFile>& idle : idle_) idle.clear();
  }
  return unchanged;
}

void ImagePool::Return(std::size_t size, ImageFile image, std::uint64_t epoch) {
  const std::lock_guard lock(mutex_);
  if (epoch != epoch_) return;
  try {
    idle_[size].push_back(std::move(image));
  } catch (const std::bad_alloc&) {
    // It is closed, and opened anew when it is wanted.
  }
}

}  // namespace terrace::dem

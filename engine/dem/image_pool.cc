#include "engine/dem/image_pool.h"

#include <algorithm>
#include <utility>

#include "engine/dem/image_bins.h"
#include "engine/dem/raster_file.h"
#include "engine/dem/sample_grid.h"

namespace terrace::dem {

ImagePool::ImagePool(ImageFile image) : path_(image.path()), files_(FilesOf(image.dataset(), image.path())) {
  GDALRasterBand& band = *image.dataset().GetRasterBand(1);
  sizes_.push_back({});
  for (const int factor : OverviewFactors(band)) {
    const GDALRasterBand* const wanted = FindOverview(band, factor);
    for (int i = 0; i < band.GetOverviewCount(); ++i) {
      if (band.GetOverview(i) != wanted) continue;
      sizes_.push_back({factor, i});
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
  {
    const std::lock_guard lock(mutex_);
    if (std::vector<ImageFile>& idle = idle_[size]; !idle.empty()) {
      Handle handle(*this, size, std::move(idle.back()));
      idle.pop_back();
      return handle;
    }
  }
  auto image = ImageFile::Open(path_, sizes_[size].overview);
  if (!image) return MakeError(ErrorCode::kUnavailable, "{}", image.error().message);
  return Handle(*this, size, *std::move(image));
}

Result<void> ImagePool::CheckUnchanged() const {
  if (const auto changed = files_.FirstChanged()) {
    return MakeError(ErrorCode::kUnavailable,
                     "{}: {} was changed, replaced or removed since it was opened; load the dataset anew", path_,
                     *changed == path_ ? "the file" : *changed);
  }
  return {};
}

void ImagePool::Return(std::size_t size, ImageFile image) {
  const std::lock_guard lock(mutex_);
  idle_[size].push_back(std::move(image));
}

}  // namespace terrace::dem

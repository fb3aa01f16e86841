#include "engine/image/image_pool.h"

#include <string>
#include <utility>

#include "engine/common/source_log.h"
#include "engine/gdal/sample_rules.h"
#include "engine/image/image_bins.h"
#include "engine/raster/raster_layout.h"

namespace terrace::dem {
namespace {

std::string WhyOverviewsMislead(const ImageFile& image) {
  if (std::string why = WhyOverviewsLackMasks(*image.dataset().GetRasterBand(1)); !why.empty()) return why;
  for (GDALRasterBand* const band : image.bands()) {
    if (std::string why = WhyOverviewsHaveOtherNodata(*band); !why.empty()) return why;
  }
  return {};
}

}  // namespace

ImagePool::ImagePool(ImageFile image, StampedFiles files) : path_(image.path()), files_(std::move(files)) {
  GDALRasterBand& band = *image.dataset().GetRasterBand(1);
  sizes_.push_back(std::make_unique<Size>());
  const std::string why = WhyOverviewsMislead(image);
  if (!why.empty()) LogSource(SourceLog::Level::kWarn, path_, "its overviews are not used: {}", why);
  for (const int factor : why.empty() ? OverviewFactors(band) : std::vector<int>()) {
    GDALRasterBand* const wanted = FindOverview(band, factor);
    for (int i = 0; i < band.GetOverviewCount(); ++i) {
      if (band.GetOverview(i) != wanted) continue;
      Size& size = *sizes_.emplace_back(std::make_unique<Size>());
      size.factor = factor;
      size.overview = i;
      size.across = PixelsPerSample(image.dataset(), factor, image.width(), wanted->GetXSize());
      size.down = PixelsPerSample(image.dataset(), factor, image.height(), wanted->GetYSize());
      break;
    }
  }
  sizes_[0]->idle.Take().Set(std::make_shared<ImageFile>(std::move(image)));
}

int ImagePool::LargestFactor() const { return sizes_.back()->factor * ImageBins::kMaxSide; }

Result<ImagePool::Borrowed> ImagePool::Borrow(int factor) {
  std::size_t i = 0;
  while (i + 1 < sizes_.size() && sizes_[i + 1]->factor <= factor) ++i;
  Size& size = *sizes_[i];
  Borrowed borrowed{&size, size.idle.Take()};
  if (borrowed.image) return borrowed;
  auto opened = ImageFile::Open(path_, size.overview);
  if (auto unchanged = CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (!opened) return MakeError(ErrorCode::kUnavailable, "{}", opened.error().message);
  borrowed.image.Set(std::make_shared<ImageFile>(*std::move(opened)));
  return borrowed;
}

Result<void> ImagePool::CheckUnchanged() {
  Result<void> unchanged = files_.CheckUnchanged(path_);
  if (!unchanged) {
    for (const auto& size : sizes_) size->idle.Clear();
  }
  return unchanged;
}

}  // namespace terrace::dem

#include "engine/dem/raster/overview_axis.h"

#include <cpl_string.h>

#include <algorithm>
#include <string_view>

namespace terrace::dem {

bool HasOwnOverviews(GDALDataset& dataset) {
  const std::string_view driver = dataset.GetDriverName();
  if (driver != "JPEG" && !driver.starts_with("JP2")) return false;
  // GDAL prefers its own overviews to the format's.
  char** const files = dataset.GetFileList();
  const bool is_beside = std::any_of(files, files + CSLCount(files),
                                     [](const char* file) { return std::string_view(file).ends_with(".ovr"); });
  CSLDestroy(files);
  return !is_beside;
}

double PixelsPerSample(GDALDataset& dataset, int factor, int pixels, int samples) {
  return HasOwnOverviews(dataset) ? factor : static_cast<double>(pixels) / samples;
}

GridAxis::Location OverviewAxis::Around(std::int64_t block) const {
  if (is_own_) return {block, 0};
  // In halves of pixels, to stay in integers: centre * samples / pixels - 1/2.
  const auto centre = static_cast<std::int64_t>(2 * blocks_.Center(block));
  const std::int64_t place = centre * samples_ - pixels_, unit = 2 * pixels_;
  if (place < 0) return {0, 0};
  const std::int64_t index = place / unit;
  if (index < samples_ - 1) return {index, static_cast<double>(place % unit) / static_cast<double>(unit)};
  if (!blocks_.wraps()) return {samples_ - 1, 0};
  const double size = static_cast<double>(pixels_) / static_cast<double>(samples_);
  const double last = static_cast<double>(pixels_) - size / 2, first = blocks_.samples() + size / 2;
  if (!(first > last)) return {samples_ - 1, 0};
  return {samples_ - 1, std::clamp((blocks_.Center(block) - last) / (first - last), 0.0, 1.0)};
}

}  // namespace terrace::dem

#include "engine/dem/statistics/overview_trust.h"

#include <cpl_string.h>

#include <algorithm>
#include <string_view>

#include "engine/dem/gdal/raster_file.h"

namespace terrace::dem {
namespace {

// By the nodata values of the file and the configuration.
std::string WhyMisleading(GDALDataset& dataset, const SampleRules& rules) {
  GDALRasterBand& band = HeightBand(dataset);
  const auto is_declared = [&](double value) { return rules.nodata && rules.IsSame(value, *rules.nodata); };
  if (!std::ranges::all_of(rules.extra_nodata, is_declared)) {
    return "they were made of samples too that `nodata` of the configuration calls voids; declare them in a copy with "
           "`gdal_translate -a_nodata VALUE in out` and make its overviews";
  }
  if (!rules.has_mask) return {};
  constexpr const char* kOwnMask =
      "; copy it with `gdal_translate --config GDAL_TIFF_INTERNAL_MASK YES in out` and make the copy's overviews";
  if (!HasMaskBand(band)) {
    return "they were made without regard to an alpha band of this type, which GDAL takes for no mask; make it one of "
           "bytes, and the overviews anew";
  }
  char** const files = dataset.GetFileList();
  const bool is_external = std::any_of(files, files + CSLCount(files),
                                       [](const char* file) { return std::string_view(file).ends_with(".msk"); });
  CSLDestroy(files);
  if (is_external) return std::string("they were made without regard to the mask in a file of its own") + kOwnMask;
  for (int i = 0; i < band.GetOverviewCount(); ++i) {
    GDALRasterBand* const overview = band.GetOverview(i);
    if (overview == nullptr) continue;
    GDALRasterBand* const mask = overview->GetMaskBand();
    const bool has_mask = HasMaskBand(*overview) && mask != nullptr && mask->GetXSize() == overview->GetXSize() &&
                          mask->GetYSize() == overview->GetYSize();
    if (!has_mask) return std::string("they have no masks, as the raster has") + kOwnMask;
  }
  return {};
}

}  // namespace

std::string DropMisleadingOverviews(GDALDataset& dataset, RasterLayout& layout) {
  if (HeightBand(dataset).GetOverviewCount() == 0) return {};
  if (layout.overview_factors.empty()) {
    return "their sides are not those of the raster by 2, 4, 8 .., rounded up or down; `gdal_translate in out` without "
           "them and `gdaladdo -r average out` make such ones";
  }
  std::string why = WhyMisleading(dataset, layout.rules);
  if (!why.empty()) layout.overview_factors.clear();
  return why;
}

std::string DropMisleadingOverviews(GDALDataset& dataset, const RasterStatistics& statistics, RasterLayout& layout) {
  if (layout.overview_factors.empty()) return {};
  int is_declared = 0;
  HeightBand(dataset).GetNoDataValue(&is_declared);
  const BlockRange all = statistics.table.Whole();
  // Cubic and Lanczos kernels overshoot their input by less than this.
  const double overshoot = 0.02 * (static_cast<double>(statistics.highest) - static_cast<double>(statistics.lowest));
  std::string why;
  if (layout.rules.has_mask) {
    if (all.min < statistics.lowest - overshoot || all.max > statistics.highest + overshoot) {
      why =
          "they have heights that the raster has not, as if they were made without its mask; copy it with "
          "`gdal_translate --config GDAL_TIFF_INTERNAL_MASK YES in out` and make the copy's overviews";
    }
  } else if (layout.rules.nodata && is_declared == 0 && statistics.voids > 0) {
    why =
        "they were made of voids too, which are not declared; declare them in a copy with "
        "`gdal_translate -a_nodata -32768 in out` and make its overviews";
  }
  if (!why.empty()) layout.overview_factors.clear();
  return why;
}

}  // namespace terrace::dem

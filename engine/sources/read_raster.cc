#include "engine/sources/read_raster.h"

#include <fmt/format.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cstdint>

#include "engine/common/dem_types.h"
#include "engine/crs/georeference.h"
#include "engine/crs/level_plan.h"
#include "engine/gdal/raster_file.h"
#include "engine/gdal/sample_rules.h"
#include "engine/sources/sample_messages.h"
#include "engine/statistics/sample_rows.h"
#include "engine/statistics/undeclared_nodata.h"

namespace terrace::dem {
namespace {

// Reads into a vector with enough capacity.
Result<void> ReadAll(GDALRasterBand& band, const SampleRules& rules, const std::function<void(double)>& progress,
                     RasterHeights& raster) {
  constexpr int kRowsAtOnce = 256;
  for (int row = 0; row < raster.height; row += kRowsAtOnce) {
    const int rows = std::min(kRowsAtOnce, raster.height - row);
    float* out = raster.heights.data() + IndexAt(0, row, raster.width);
    if (auto read = ReadHeights(band, rules, 0, row, raster.width, rows, out, {}); !read) return read;
    if (progress) progress(static_cast<double>(row + rows) / raster.height);
  }
  return {};
}

// Detects undeclared voids of a raster in memory, by the same rules as for served rasters (raster_statistics.h).
Result<DetectedNodata> FindVoidsOf(const RasterHeights& raster, GDALRasterBand& band, const SampleRules& rules,
                                   double spacing_m) {
  BlockRange range;
  const std::int64_t valid = AddToRange(raster.heights, range);
  ZeroEdges zeros;
  const double coast_step_m = ZeroEdges::CoastStep(spacing_m);
  zeros.Add(raster.heights.data(), raster.width, {0, 0, raster.width, raster.height}, raster.width, raster.height,
            coast_step_m);
  const bool has_collar = zeros.IsCollar(raster.width, raster.height);
  if (valid == 0 || !MayHideVoids(rules, range.min, range.max, range.has_voids, has_collar)) return DetectedNodata{};
  return FindVoids(band, rules, has_collar, coast_step_m);
}

}  // namespace

Result<RasterHeights> ReadRaster(const std::string& path, const ReadOptions& options) {
  auto dataset = OpenRaster(path);
  if (!dataset) return tl::unexpected(dataset.error());
  if (auto complete = CheckComplete(**dataset, path); !complete) return tl::unexpected(complete.error());
  RasterHeights raster;
  raster.width = (*dataset)->GetRasterXSize();
  raster.height = (*dataset)->GetRasterYSize();
  if (auto fits = CheckSizeToMesh(path, raster.width, raster.height); !fits) return tl::unexpected(fits.error());
  raster.georeferenced = (*dataset)->GetGeoTransform(raster.geo_transform.data()) == CE_None;
  GDALRasterBand& band = HeightBand(**dataset);
  raster.picture_color = PictureColorOf(band);
  // Rasters that are only meshed need no georeference; if they have none, no CRS states the unit of heights.
  const auto georeference = Georeference::Of(**dataset, path);
  const auto spacing = georeference ? SourceSpacing::Of(*georeference, path) : SourceSpacing{};
  if (georeference && MetresPerUnit(georeference->pixel_unit()).value_or(1) != 1) {
    raster.coordinate_unit = georeference->pixel_unit();
  }
  const OGRSpatialReference* const crs = (*dataset)->GetSpatialRef();
  raster.in_angles = raster.georeferenced && crs != nullptr && crs->IsGeographic() != 0;
  SampleRules rules = SampleRules::Of(band, georeference ? georeference->vertical_unit() : "");
  rules.extra_nodata = options.nodata;
  if (auto scaled = CheckScale(rules, path); !scaled) return tl::unexpected(scaled.error());
  // With spare capacity, so that tin::HeightField can increase the stride without a copy.
  constexpr std::size_t kRoomOfRow = 32;
  raster.heights.reserve((static_cast<std::size_t>(raster.width) + kRoomOfRow) *
                         static_cast<std::size_t>(raster.height));
  raster.heights.resize(Area(raster.width, raster.height));
  const auto damaged = [&](const Error& error) {
    return MakeError(error.code, "{}: {}; the file may be damaged: check it with gdalinfo -checksum", path,
                     error.message);
  };
  if (auto read = ReadAll(band, rules, options.progress, raster); !read) return damaged(read.error());
  const auto finish = [&]() -> Result<RasterHeights> {
    BlockRange range;
    if (AddToRange(raster.heights, range) == 0)
      return MakeError(ErrorCode::kNotFound, "{}", DescribeLackOfHeights(rules, path));
    raster.heights_doubted = MetresPerUnit(rules.unit)
                                 ? DoubtsOf({range.min, range.max})
                                 : fmt::format(
                                       "height unit \"{}\" is not known, heights are taken as metres: state metres a "
                                       "unit with `gdal_translate -a_scale FACTOR in out`",
                                       rules.unit);
    return std::move(raster);
  };
  if (!options.find_voids) return finish();
  const auto detected = FindVoidsOf(raster, band, rules, spacing ? spacing->finer : 0);
  if (!detected) return damaged(detected.error());
  if (!detected->any()) return finish();
  raster.found_voids = detected->text;
  detected->AddTo(rules);
  if (auto read = ReadAll(band, rules, {}, raster); !read) return damaged(read.error());
  return finish();
}

}  // namespace terrace::dem

#include <algorithm>

#include "engine/dem/dem_source.h"
#include "engine/dem/raster_file.h"
#include "engine/dem/sample_rules.h"

namespace terrace::dem {

Result<RasterHeights> ReadRaster(const std::string& path, const std::function<void(double)>& progress) {
  constexpr int kRowsAtOnce = 256;
  auto dataset = OpenRaster(path);
  if (!dataset) return tl::unexpected(dataset.error());
  RasterHeights raster;
  raster.width = (*dataset)->GetRasterXSize();
  raster.height = (*dataset)->GetRasterYSize();
  if (auto fits = CheckSizeToMesh(path, raster.width, raster.height); !fits) return tl::unexpected(fits.error());
  raster.georeferenced = (*dataset)->GetGeoTransform(raster.geo_transform.data()) == CE_None;
  GDALRasterBand& band = HeightBand(**dataset);
  const SampleRules rules = SampleRules::Of(band, "");
  // With room for a mesher to lay rows further apart (tin::HeightField) without a second copy of all.
  constexpr std::size_t kRoomOfRow = 32;
  raster.heights.reserve((static_cast<std::size_t>(raster.width) + kRoomOfRow) *
                         static_cast<std::size_t>(raster.height));
  raster.heights.resize(static_cast<std::size_t>(raster.width) * static_cast<std::size_t>(raster.height));
  for (int row = 0; row < raster.height; row += kRowsAtOnce) {
    const int rows = std::min(kRowsAtOnce, raster.height - row);
    float* out = raster.heights.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(raster.width);
    if (auto read = ReadHeights(band, rules, 0, row, raster.width, rows, out, {}); !read) {
      return MakeError(read.error().code, "{}: {}; the file may be damaged: check it with gdalinfo -checksum", path,
                       read.error().message);
    }
    if (progress) progress(static_cast<double>(row + rows) / raster.height);
  }
  return raster;
}

}  // namespace terrace::dem

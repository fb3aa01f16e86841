#include <algorithm>

#include "engine/dem/dem_source.h"
#include "engine/dem/raster_file.h"
#include "engine/dem/sample_rules.h"

namespace terrace::dem {

Result<RasterHeights> ReadRaster(const std::string& path, const std::function<void(double)>& progress) {
  // Two gigabytes of floats: what is meshed in one piece must fit in memory several times over.
  constexpr std::int64_t kMostSamples = std::int64_t{1} << 29;
  constexpr int kMostPerSide = 1 << 15;  // the mesher's coordinates have 15 bits
  constexpr int kRowsAtOnce = 256;
  auto dataset = OpenRaster(path);
  if (!dataset) return tl::unexpected(dataset.error());
  RasterHeights raster;
  raster.width = (*dataset)->GetRasterXSize();
  raster.height = (*dataset)->GetRasterYSize();
  if (std::int64_t{raster.width} * raster.height > kMostSamples ||
      std::max(raster.width, raster.height) > kMostPerSide) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: {} x {} samples are too many to mesh in one piece (at most {} in all and {} a side); cut it "
                     "with gdal_translate -srcwin",
                     path, raster.width, raster.height, kMostSamples, kMostPerSide);
  }
  raster.georeferenced = (*dataset)->GetGeoTransform(raster.geo_transform.data()) == CE_None;
  GDALRasterBand& band = HeightBand(**dataset);
  const SampleRules rules = SampleRules::Of(band, "");
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

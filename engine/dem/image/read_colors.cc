#include <algorithm>
#include <cmath>

#include "engine/dem/gdal/raster_file.h"
#include "engine/dem/image/image_bins.h"
#include "engine/dem/image/image_file.h"
#include "engine/dem/image/image_placement.h"
#include "engine/dem/image/raster_colors.h"
#include "engine/dem/sources/read_raster.h"

namespace terrace::dem {
namespace {

constexpr int kRowsAtOnce = 64;      // of the DEM: limits the memory for a much finer image
constexpr double kBeyondEdge = 0.5;  // pixels

// The number of pixels between two samples in the middle of the DEM, on the axis with fewer.
int PixelsPerSample(const ImagePlacement& placement, const RasterHeights& dem) {
  const double x = dem.width / 2.0, y = dem.height / 2.0;
  std::array<Position, 3> positions = {{{x, y}, {x + 1, y}, {x, y + 1}}};
  placement.ToImage(positions);
  const auto& [middle, right, below] = positions;
  const double pixels =
      std::min(std::hypot(right.x - middle.x, right.y - middle.y), std::hypot(below.x - middle.x, below.y - middle.y));
  if (!(pixels > 1)) return 1;
  return static_cast<int>(std::min(pixels + 1e-6, static_cast<double>(ImageBins::kMaxPixels)));
}

bool Covers(const ImageFile& image, const Position& p) {
  return p.x >= -kBeyondEdge && p.x <= image.width() + kBeyondEdge && p.y >= -kBeyondEdge &&
         p.y <= image.height() + kBeyondEdge;  // false for NaN
}

}  // namespace

Result<std::vector<ColorSample>> ReadColors(const std::string& image_path, const std::string& dem_path,
                                            const RasterHeights& dem, const std::function<void(double)>& progress) {
  auto image = ImageFile::Open(image_path);
  if (!image) return tl::unexpected(image.error());
  const auto dem_file = OpenRaster(dem_path);
  if (!dem_file) return tl::unexpected(dem_file.error());
  const auto placement = ImagePlacement::Of(**dem_file, dem_path, image->dataset(), image_path);
  if (!placement) return tl::unexpected(placement.error());

  const int side = PixelsPerSample(*placement, dem);
  std::vector<ColorSample> colors;
  colors.reserve(dem.heights.size());
  std::vector<Position> positions;
  for (int first = 0; first < dem.height; first += kRowsAtOnce) {
    const int last = std::min(first + kRowsAtOnce, dem.height);
    positions.clear();
    for (int row = first; row < last; ++row) {
      for (int col = 0; col < dem.width; ++col) positions.push_back({col + 0.5, row + 0.5});
    }
    placement->ToImage(positions);
    for (std::size_t i = 0; i < positions.size(); ++i) {
      Position& p = positions[i];
      if (Covers(*image, p)) continue;
      const std::size_t sample = colors.size() + i;
      if (!std::isnan(dem.heights[sample])) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "{} does not cover {}: the sample in column {}, row {} lies at pixel ({:.1f}, {:.1f}) of its {} "
            "x {}; take an image of the whole area, or cut the DEM to the image with gdalwarp -te",
            image_path, dem_path, sample % static_cast<std::size_t>(dem.width),
            sample / static_cast<std::size_t>(dem.width), p.x, p.y, image->width(), image->height());
      }
      p = {NAN, NAN};
    }
    const auto bins = ImageBins::Read(*image, side, positions);
    if (!bins) return tl::unexpected(bins.error());
    for (const Position& p : positions) colors.push_back(bins->At(p));
    if (progress) progress(static_cast<double>(last) / dem.height);
  }
  return colors;
}

Result<RasterColors> ReadImage(const std::string& path, const std::function<void(double)>& progress) {
  constexpr int kImageRowsAtOnce = 256;
  auto image = ImageFile::Open(path);
  if (!image) return tl::unexpected(image.error());
  RasterColors raster;
  raster.width = image->width();
  raster.height = image->height();
  if (auto fits = CheckSizeToMesh(path, raster.width, raster.height); !fits) return tl::unexpected(fits.error());
  raster.georeferenced = image->dataset().GetGeoTransform(raster.geo_transform.data()) == CE_None;
  raster.colors.resize(static_cast<std::size_t>(raster.width) * static_cast<std::size_t>(raster.height));
  for (int row = 0; row < raster.height; row += kImageRowsAtOnce) {
    const int rows = std::min(kImageRowsAtOnce, raster.height - row);
    ColorSample* const out =
        raster.colors.data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(raster.width);
    if (auto read = image->Read(0, row, raster.width, rows, out); !read) return tl::unexpected(read.error());
    if (progress) progress(static_cast<double>(row + rows) / raster.height);
  }
  return raster;
}

}  // namespace terrace::dem

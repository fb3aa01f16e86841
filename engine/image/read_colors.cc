#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/crs/georeference.h"
#include "engine/crs/projector.h"
#include "engine/gdal/raster_file.h"
#include "engine/image/image_bins.h"
#include "engine/image/image_file.h"
#include "engine/image/raster_colors.h"
#include "engine/sources/read_raster.h"

namespace terrace::dem {
namespace {

constexpr int kRowsAtOnce = 64;      // of the DEM: limits the memory for a much finer image
constexpr double kBeyondEdge = 0.5;  // pixels

bool HasCrs(const OGRSpatialReference* srs) { return srs != nullptr && !srs->IsEmpty(); }

// Whether positions in one are positions in the other; the vertical part does not matter. False for degrees, because
// they may differ by full circles.
bool ShareCoordinates(const OGRSpatialReference* a, const OGRSpatialReference* b) {
  if (!HasCrs(a) && !HasCrs(b)) return true;
  if (!HasCrs(a) || !HasCrs(b)) return false;
  const OGRSpatialReference horizontal_a = HorizontalPart(*a), horizontal_b = HorizontalPart(*b);
  const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES", nullptr};
  return horizontal_a.IsGeographic() == 0 && horizontal_a.IsSame(&horizontal_b, options) != 0;
}

// Maps samples of a DEM to pixels of an image.
class ImagePlacement {
 public:
  // Uses the georeferences of both files. If one of them has none, both must have the same size, and pixels map to
  // samples one to one. Error messages say which file lacks what.
  static Result<ImagePlacement> Of(GDALDataset& dem, const std::string& dem_path, GDALDataset& image,
                                   const std::string& image_path) {
    ImagePlacement placement;
    std::array<double, 6> dem_to_crs{}, image_to_crs{}, crs_to_image{};
    const bool is_dem_placed = dem.GetGeoTransform(dem_to_crs.data()) == CE_None,
               is_image_placed = image.GetGeoTransform(image_to_crs.data()) == CE_None;
    if (!is_dem_placed || !is_image_placed) {
      const int dem_width = dem.GetRasterXSize(), dem_height = dem.GetRasterYSize();
      if (image.GetRasterXSize() != dem_width || image.GetRasterYSize() != dem_height) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "{} has {} x {} pixels and {} has {} x {} samples, and {} has no georeference to place one on the "
            "other; bring the image to the same area and size with `gdal_translate -outsize {} {} in out.tif` "
            "or add what is missing with `gdal_translate -a_srs EPSG:XXXX -a_ullr west north east south in "
            "out.tif`",
            image_path, image.GetRasterXSize(), image.GetRasterYSize(), dem_path, dem_width, dem_height,
            is_dem_placed ? image_path : dem_path, dem_width, dem_height);
      }
      placement.affine_ = {0, 1, 0, 0, 0, 1};
      return placement;
    }
    if (ShareCoordinates(dem.GetSpatialRef(), image.GetSpatialRef()) &&
        GDALInvGeoTransform(image_to_crs.data(), crs_to_image.data()) != 0) {
      GDALComposeGeoTransforms(dem_to_crs.data(), crs_to_image.data(), placement.affine_.data());
      return placement;
    }
    auto of_dem = Georeference::Of(dem, dem_path);
    if (!of_dem) return tl::unexpected(of_dem.error());
    auto of_image = Georeference::Of(image, image_path);
    if (!of_image) return tl::unexpected(of_image.error());
    placement.georeferences_ = {*std::move(of_dem), *std::move(of_image)};
    return placement;
  }

  // Converts pixel positions of the DEM to pixel positions of the image (georeference.h), in place; NaN if there is
  // none.
  void ToImage(std::span<Position> positions) const {
    if (georeferences_) {
      georeferences_->dem.ToDegrees(positions);
      georeferences_->image.ToPixels(positions);
      return;
    }
    for (Position& p : positions) {
      p = {affine_[0] + p.x * affine_[1] + p.y * affine_[2], affine_[3] + p.x * affine_[4] + p.y * affine_[5]};
    }
  }

 private:
  struct Georeferences {
    Georeference dem, image;
  };

  std::array<double, 6> affine_{};  // DEM to image, if both have the same projected reference system or none
  std::optional<Georeferences> georeferences_;  // else
};

// The number of pixels between two samples in the middle of the DEM, on the axis with fewer.
int PixelsPerSample(const ImagePlacement& placement, const RasterHeights& dem) {
  const double x = dem.width / 2.0, y = dem.height / 2.0;
  std::array<Position, 3> positions = {{{x, y}, {x + 1, y}, {x, y + 1}}};
  placement.ToImage(positions);
  const auto& [middle, right, below] = positions;
  const double pixels =
      std::min(std::hypot(right.x - middle.x, right.y - middle.y), std::hypot(below.x - middle.x, below.y - middle.y));
  if (!(pixels > 1)) return 1;
  return static_cast<int>(std::min(pixels + 1e-6, static_cast<double>(ImageBins::kMaxSide)));
}

bool Covers(const ImageFile& image, const Position& p) {
  return p.x >= -kBeyondEdge && p.x <= image.width() + kBeyondEdge && p.y >= -kBeyondEdge &&
         p.y <= image.height() + kBeyondEdge;  // false for NaN
}

}  // namespace

Result<std::vector<Rgba>> ReadColors(const std::string& image_path, const std::string& dem_path,
                                     const RasterHeights& dem, const std::function<void(double)>& progress) {
  auto image = ImageFile::Open(image_path);
  if (!image) return tl::unexpected(image.error());
  const auto dem_file = OpenRaster(dem_path);
  if (!dem_file) return tl::unexpected(dem_file.error());
  const auto placement = ImagePlacement::Of(**dem_file, dem_path, image->dataset(), image_path);
  if (!placement) return tl::unexpected(placement.error());

  const int side = PixelsPerSample(*placement, dem);
  std::vector<Rgba> colors;
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
  raster.colors.resize(Area(raster.width, raster.height));
  for (int row = 0; row < raster.height; row += kImageRowsAtOnce) {
    const int rows = std::min(kImageRowsAtOnce, raster.height - row);
    Rgba* const out = raster.colors.data() + IndexAt(0, row, raster.width);
    if (auto read = image->Read(0, row, raster.width, rows, out); !read) return tl::unexpected(read.error());
    if (progress) progress(static_cast<double>(row + rows) / raster.height);
  }
  return raster;
}

}  // namespace terrace::dem

#include "engine/dem/image/image_placement.h"

#include <ogr_spatialref.h>

#include <utility>

namespace terrace::dem {
namespace {

bool HasCrs(const OGRSpatialReference* srs) { return srs != nullptr && !srs->IsEmpty(); }

// Returns the horizontal part: the vertical datum does not matter for an image.
OGRSpatialReference Horizontal(const OGRSpatialReference& srs) {
  OGRSpatialReference horizontal(srs);
  if (horizontal.IsCompound() != 0) horizontal.StripVertical();
  if (horizontal.GetAxesCount() == 3) horizontal.DemoteTo2D(nullptr);
  return horizontal;
}

// Whether positions in one system are positions in the other. False for degrees, which may differ by full circles.
bool ShareCoordinates(const OGRSpatialReference* a, const OGRSpatialReference* b) {
  if (!HasCrs(a) && !HasCrs(b)) return true;
  if (!HasCrs(a) || !HasCrs(b)) return false;
  const OGRSpatialReference horizontal_a = Horizontal(*a), horizontal_b = Horizontal(*b);
  const char* const options[] = {"IGNORE_DATA_AXIS_TO_SRS_AXIS_MAPPING=YES", nullptr};
  return horizontal_a.IsGeographic() == 0 && horizontal_a.IsSame(&horizontal_b, options) != 0;
}

}  // namespace

Result<ImagePlacement> ImagePlacement::Of(GDALDataset& dem, const std::string& dem_path, GDALDataset& image,
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
    placement.is_one_to_one_ = true;
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

void ImagePlacement::ToImage(std::span<Position> positions) const {
  if (georeferences_) {
    georeferences_->dem.ToDegrees(positions);
    georeferences_->image.ToPixels(positions);
    return;
  }
  for (Position& p : positions) {
    p = {affine_[0] + p.x * affine_[1] + p.y * affine_[2], affine_[3] + p.x * affine_[4] + p.y * affine_[5]};
  }
}

}  // namespace terrace::dem

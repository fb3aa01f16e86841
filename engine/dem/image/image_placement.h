// Which pixel of an image lies under a sample of a DEM.
#pragma once

#include <gdal_priv.h>

#include <array>
#include <optional>
#include <span>
#include <string>

#include "engine/core/result.h"
#include "engine/dem/crs/georeference.h"
#include "engine/dem/crs/projector.h"

namespace terrace::dem {

// Immutable and thread-safe.
class ImagePlacement {
 public:
  // By the georeferences of both files, or one to one where they have the same size and not both have one; errors say
  // which file lacks what.
  static Result<ImagePlacement> Of(GDALDataset& dem, const std::string& dem_path, GDALDataset& image,
                                   const std::string& image_path);

  // Pixel positions of the DEM to pixel positions of the image (georeference.h), in place; NaN where there is none.
  void ToImage(std::span<Position> positions) const;

  bool is_one_to_one() const { return is_one_to_one_; }

 private:
  struct Georeferences {
    Georeference dem, image;
  };

  bool is_one_to_one_ = false;
  std::array<double, 6> affine_{};              // DEM to image, where a projected reference system is the same or none
  std::optional<Georeferences> georeferences_;  // else
};

}  // namespace terrace::dem

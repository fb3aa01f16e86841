// Maps samples of a DEM to pixels of an image.
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
  // Uses the georeferences of both files. If one of them has none, both must have the same size, and pixels map to
  // samples one to one. Error messages say which file lacks what.
  static Result<ImagePlacement> Of(GDALDataset& dem, const std::string& dem_path, GDALDataset& image,
                                   const std::string& image_path);

  // Converts pixel positions of the DEM to pixel positions of the image (georeference.h), in place; NaN if there is
  // none.
  void ToImage(std::span<Position> positions) const;

  bool is_one_to_one() const { return is_one_to_one_; }

 private:
  struct Georeferences {
    Georeference dem, image;
  };

  bool is_one_to_one_ = false;
  std::array<double, 6> affine_{};  // DEM to image, if both have the same projected reference system or none
  std::optional<Georeferences> georeferences_;  // in all other cases
};

}  // namespace terrace::dem

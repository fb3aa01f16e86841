// Colours from images: for every sample of a DEM that an image covers, or for every pixel of an image itself.
//
// Images are what GDAL reads with 1 band (grey), 3 or 4 (red, green, blue and alpha or whatever else), or a palette; 8
// or 16 bits a band. Colours come back as 8 bits each, red, green, blue and alpha: 255, or 0 where the image is
// transparent or says that it has no data.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/sources/read_raster.h"

namespace terrace::dem {

using ColorSample = std::array<std::uint8_t, 4>;

// The colours under the samples of `dem`, which ReadRaster has read from `dem_path`, in the same order.
//
// Where both files have a georeference, samples are placed by it, through PROJ where the reference systems differ, and
// the image is interpolated bilinearly; where its pixels are finer than the samples, between averages of as many whole
// pixels, k x k, as fit one sample's spacing in the middle of the DEM. Else both must have the same size, and pixel
// belongs to sample. kInvalidArgument, with the remedy: they have not; the image has no colour bands that this can
// read; it ends more than half a pixel before a sample that has a height.
Result<std::vector<ColorSample>> ReadColors(const std::string& image_path, const std::string& dem_path,
                                            const RasterHeights& dem, const std::function<void(double)>& progress = {});

// An image as it lies in the file, row 0 on top, no georeference needed.
struct RasterColors {
  int width = 0, height = 0;
  std::vector<ColorSample> colors;
  bool georeferenced = false;
  std::array<double, 6> geo_transform{};  // GDAL's order, as in RasterHeights
};
Result<RasterColors> ReadImage(const std::string& path, const std::function<void(double)>& progress = {});

}  // namespace terrace::dem

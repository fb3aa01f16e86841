// Reads colours from images: for the samples of a DEM that an image covers, or for the pixels of an image itself.
// GDAL must read the image with 1 band (grey), 3 or 4 bands (red, green, blue, and alpha or anything else), or a
// palette, in 8 or 16 bits per band. Colours are returned as 8-bit red, green, blue and alpha. Alpha is 255, or 0 for
// pixels that are transparent or have no data.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/result.h"
#include "engine/sources/read_raster.h"

namespace terrace::dem {

// Returns the colours at the samples of `dem`, which ReadRaster has read from `dem_path`, in the same order.
// If both files have a georeference, samples are located by it, through PROJ if the reference systems differ, and the
// image is interpolated bilinearly. If its pixels are finer than the samples, it is interpolated between averages of k
// x k whole pixels, as many as fit the spacing of samples in the middle of the DEM. Otherwise both files must have the
// same size, and pixels map to samples one to one. kInvalidArgument, with the remedy: the sizes differ; the image has
// no readable colour bands; it ends more than half a pixel before a sample that has a height.
Result<std::vector<Rgba>> ReadColors(const std::string& image_path, const std::string& dem_path,
                                     const RasterHeights& dem, const std::function<void(double)>& progress = {});

// The pixels of an image in the order of the file, row 0 on top. Needs no georeference.
struct RasterColors {
  int width = 0, height = 0;
  std::vector<Rgba> colors;
  bool georeferenced = false;
  std::array<double, 6> geo_transform{};  // GDAL's order, as in RasterHeights
};
Result<RasterColors> ReadImage(const std::string& path, const std::function<void(double)>& progress = {});

}  // namespace terrace::dem

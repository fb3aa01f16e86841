// A window of an image, averaged over squares of pixels: what colours are interpolated from.
#pragma once

#include <array>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/crs/projector.h"
#include "engine/dem/image/image_file.h"
#include "engine/dem/image/raster_colors.h"

namespace terrace::dem {

class ImageBins {
 public:
  // A side of a square, in pixels: sums of its levels stay below 2^32.
  static constexpr int kMaxPixels = 4096;

  // Reads the squares, `side` pixels wide and counted from the image's first pixel, that interpolation at these pixel
  // positions needs; NaNs need none. kInvalidArgument: more than fit in memory. kUnavailable: the image cannot be read.
  // kCancelled: stopped.
  static Result<ImageBins> Read(ImageFile& image, int side, const std::vector<Position>& positions,
                                const std::stop_token& stop = {});

  // Bilinear between the averages of the nearest four squares, as far as they have a colour, and the image's own edge
  // where it ends; no colour where none of them has one, or at a NaN.
  ColorSample At(Position position) const;

 private:
  struct Bin {
    std::array<std::uint32_t, 3> sums{};
    std::uint32_t count = 0;  // of pixels that are there
  };

  // The squares to the lower side of a position on one axis, and to the upper; the share of the upper one.
  struct Between {
    int lower, upper;
    double share;
  };
  static Between Around(double position, int side, int last);

  Result<void> Fill(ImageFile& image, const std::stop_token& stop);

  int side_ = 1;
  int last_col_ = 0, last_row_ = 0;                          // of the image's squares
  int first_col_ = 0, first_row_ = 0, cols_ = 0, rows_ = 0;  // of those here
  std::vector<Bin> bins_;
};

}  // namespace terrace::dem

// A window of an image, averaged over squares of pixels. Colours are interpolated between these averages.
#pragma once

#include <array>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/crs/projector.h"
#include "engine/image/image_file.h"
#include "engine/image/raster_colors.h"

namespace terrace::dem {

class ImageBins {
 public:
  // The largest side of a square in pixels: sums of its levels stay below 2^32.
  static constexpr int kMaxSide = 4096;

  // Reads the squares that interpolation at these pixel positions needs. Squares are `side` pixels wide and aligned to
  // the image's first pixel. NaN positions are ignored. kInvalidArgument: too many squares for the memory.
  // kUnavailable: the image cannot be read. kCancelled: stopped.
  static Result<ImageBins> Read(ImageFile& image, int side, const std::vector<Position>& positions,
                                const std::stop_token& stop = {});

  // Interpolates bilinearly between the averages of the nearest four squares that have a colour. Beyond the image's
  // edge the edge colour is used. Returns no colour if none of the squares has one, or for NaN.
  Rgba At(Position position) const;

 private:
  struct Bin {
    std::array<std::uint32_t, 3> sums{};
    std::uint32_t count = 0;  // of valid pixels
  };

  // The squares below and above a position on one axis, and the weight of the upper one.
  struct Neighbors {
    int lower, upper;
    double share;
  };
  static Neighbors Around(double position, int side, int last);

  // Chooses the columns of squares in bins_: of those from `west` to `east`, the needed ones with what lies between.
  void ChooseColumns(const std::vector<bool>& is_needed, int west, int east);
  Result<void> Fill(ImageFile& image, const std::stop_token& stop);
  Result<void> FillColumns(ImageFile& image, int first_col, int cols, const std::stop_token& stop);
  int Column(int col) const { return col - first_col_ - (col >= gap_end_ ? gap_ : 0); }  // in bins_

  int side_ = 1;
  int last_col_ = 0, last_row_ = 0;                          // last square of the image
  int first_col_ = 0, first_row_ = 0, cols_ = 0, rows_ = 0;  // of the squares in bins_
  int gap_end_ = 0, gap_ = 0;                                // columns that bins_ leaves out, and the first one after
  std::vector<Bin> bins_;
};

}  // namespace terrace::dem

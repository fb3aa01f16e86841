// An extended height field, H(x, y) = (z, r, g, b): every sample has a height and a colour, and one error combines
// both.
//
// Garland and Heckbert, "Fast Triangular Approximation of Terrains and Height Fields" (1997), section 3.5. Let a sample
// differ from the surface by dz metres and by dr, dg and db, with colours from 0 to 1. Its error is
//   (1 - w) |dz| + w (M / 3) (|dr| + |dg| + |db|)  metres,
// with the weight w of colour, 0 to 1, and the range M of the valid heights: the full range of colours counts as much
// as the full range of heights. If all heights are equal, M is 1 here and 0 in the paper: a flat field with w = 1 is
// then an image, and its error is a share of the range of colours.
//
// Immutable after Make: safe to use from many threads at once.
#pragma once

#include <cstddef>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/result.h"
#include "engine/tin/mesh/height_field.h"

namespace terrace::tin {

class ExtendedField {
 public:
  // `colors` has one element per height, in the same order. A sample without a height is a void, whatever its colour.
  // The error of a sample without a colour is that of its height alone. Refuses a wrong number of colours, a weight
  // outside 0 to 1, and colours of which none is known.
  static Result<ExtendedField> Make(HeightField heights, std::vector<Rgba> colors, double color_weight);

  const HeightField& heights() const { return heights_; }
  int width() const { return heights_.width(); }
  int height() const { return heights_.height(); }
  const Rgba& ColorAt(int x, int y) const { return ColorRow(y)[x]; }
  const Rgba* ColorRow(int y) const {
    return colors_.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width());
  }
  static bool IsKnown(const Rgba& color) { return color[3] != 0; }

  // The known colour nearest to a position; ties go to the smaller row, then column. Searches all samples.
  Rgb NearestColor(int x, int y) const;

  // The combined error for a height difference in metres and the sum of the differences in red, green and blue, in
  // 255ths of the range.
  double Error(double metres, double levels) const { return height_weight_ * metres + level_weight_ * levels; }
  double color_weight() const { return color_weight_; }

 private:
  ExtendedField(HeightField heights, std::vector<Rgba> colors, double color_weight);

  HeightField heights_;
  std::vector<Rgba> colors_;
  double color_weight_;   // w
  double height_weight_;  // 1 - w
  double level_weight_;   // w M / 3 / 255
};

}  // namespace terrace::tin

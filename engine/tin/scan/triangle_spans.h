// The samples of a triangle as exact integer spans, row by row, and loops over them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/plane.h"
#include "engine/tin/mesh/star.h"

namespace terrace::tin {

// Where an edge that is not horizontal crosses rows: at x = n / dy with integers n = x0 dy + (y - y0) dx and dy > 0.
//
// Floor and Ceil are exact with one multiplication. 0 <= n < 2^30 and dy < 2^15, so the error of n * (1 / dy) is less
// than 2^-36. A quotient that is not an integer is at least 2^-15 below the next integer. Adding 2^-17 therefore
// corrects an integer that was rounded down, and moves no other quotient past an integer.
class EdgeCrossing {
 public:
  EdgeCrossing(const Corner& low, const Corner& high)
      : x0_(low.x), y0_(low.y), dx_(high.x - low.x), dy_(high.y - low.y), inverse_(1.0 / dy_) {}

  int Floor(int y) const { return Quotient(x0_ * dy_ + (y - y0_) * dx_); }
  int Ceil(int y) const { return Quotient(x0_ * dy_ + (y - y0_) * dx_ + dy_ - 1); }

 private:
  int Quotient(int n) const { return static_cast<int>(n * inverse_ + 0x1p-17); }

  int x0_, y0_, dx_, dy_;
  double inverse_;
};

// Calls visit(y, first, last), rows ascending, for the samples of the closed triangle without its corners and without
// the border of a field of `width` columns and `height` rows; first <= last. Samples on an edge are visited for both
// triangles.
template <typename Visit>
void ForEachInnerSpan(const std::array<Corner, 3>& sorted, double doubled_area, int width, int height, Visit&& visit) {
  const auto& [low, middle, high] = sorted;
  const auto clipped = [&](int y, int first, int last) {
    first = std::max(first, 1);
    last = std::min(last, width - 2);
    if (first <= last) visit(y, first, last);
  };
  // A horizontal edge is in the first or the last row. Only such rows can lie on the southern or northern border.
  if (low.y == middle.y && low.y > 0) clipped(low.y, low.x + 1, middle.x - 1);
  if (high.y - low.y >= 2) {
    const EdgeCrossing across(low, high);
    const bool middle_is_right = doubled_area > 0;
    const auto rows = [&](int from, int to, const EdgeCrossing& around) {
      const EdgeCrossing& left = middle_is_right ? across : around;
      const EdgeCrossing& right = middle_is_right ? around : across;
      for (int y = from; y <= to; ++y) clipped(y, left.Ceil(y), right.Floor(y));
    };
    if (middle.y > low.y + 1) rows(low.y + 1, middle.y - 1, EdgeCrossing(low, middle));
    if (middle.y > low.y && middle.y < high.y) {
      if (middle_is_right) {
        clipped(middle.y, across.Ceil(middle.y), middle.x - 1);
      } else {
        clipped(middle.y, middle.x + 1, across.Floor(middle.y));
      }
    }
    if (high.y > middle.y + 1) rows(middle.y + 1, high.y - 1, EdgeCrossing(middle, high));
  }
  if (middle.y == high.y && high.y < height - 1) clipped(high.y, middle.x + 1, high.x - 1);
}

// Sum of the squared vertical distances, in square metres, of the samples that ForEachInnerSpan visits. Samples on an
// edge count one half in each of the two triangles. Voids are skipped. Safe to call from many threads at once.
double SquaredDistances(const HeightField& field, const std::array<Corner, 3>& corners);

// Whether no valid sample of the triangle is more than `bound` metres from its plane, vertically. The samples are those
// of ForEachInnerSpan: of the closed triangle, without its corners and the field's border. A negative bound asks
// whether there are no valid samples. Corners in any order, not on one line. Safe to call from many threads at once.
bool SamplesAreWithin(const HeightField& field, const std::array<Corner, 3>& corners, double bound);

// Number of the first sample that a scan of the star's triangle i reads (triangle_scan.h); kNoSample if there is none.
std::uint32_t FirstSample(const HeightField& field, const Star& star, std::size_t i);

}  // namespace terrace::tin

#include "engine/tin/height_field.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace terrace::tin {

Result<HeightField> HeightField::Make(int width, int height, std::vector<float> heights) {
  if (width < 2 || height < 2 || width > kMaxSide || height > kMaxSide) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a height field of {} x {} samples cannot be triangulated: each side needs 2 to {} samples", width,
                     height, kMaxSide);
  }
  const std::size_t samples = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (heights.size() != samples) {
    return MakeError(ErrorCode::kInvalidArgument, "a height field of {} x {} samples needs {} heights, not {}", width,
                     height, samples, heights.size());
  }
  std::size_t voids = 0;
  for (float& value : heights) {
    if (std::isfinite(value)) continue;
    value = std::numeric_limits<float>::quiet_NaN();
    ++voids;
  }
  if (voids == samples) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "all {} x {} samples of the height field are void: at least one needs a height", width, height);
  }
  return HeightField(width, height, std::move(heights), voids > 0);
}

float HeightField::VertexHeight(int x, int y) const {
  const float own = At(x, y);
  if (!std::isnan(own)) return own;

  // Rings of growing Chebyshev distance r: every sample on ring r is at least r away, so a sample that was found at a
  // squared distance below r^2 cannot be beaten any more; at r^2 exactly it can still be tied.
  std::int64_t best = std::numeric_limits<std::int64_t>::max();
  int best_x = 0, best_y = 0;
  for (int r = 1; r < std::max(width_, height_) && std::int64_t{r} * r <= best; ++r) {
    for (int row = std::max(y - r, 0); row <= std::min(y + r, height_ - 1); ++row) {
      const int step = (row == y - r || row == y + r) ? 1 : 2 * r;
      for (int column = x - r; column <= x + r; column += step) {
        if (column < 0 || column >= width_ || std::isnan(At(column, row))) continue;
        const std::int64_t dx = column - x, dy = row - y, distance = dx * dx + dy * dy;
        const bool nearer =
            distance < best || (distance == best && (row < best_y || (row == best_y && column < best_x)));
        if (!nearer) continue;
        best = distance;
        best_x = column;
        best_y = row;
      }
    }
  }
  return At(best_x, best_y);
}

}  // namespace terrace::tin

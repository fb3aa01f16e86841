#include "engine/tin/mesh/height_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "engine/tin/mesh/height_scans.h"

namespace terrace::tin {
namespace {

// If rows are about a page apart, the samples of a column share one set of the first-level cache, which has about a
// dozen lines: a triangle with more rows would evict its own samples. A stride of an odd number of cache lines avoids
// this. Rows of tiles are shorter and stored without gaps.
std::size_t StrideFor(int width) {
  constexpr std::size_t kSamplesOfLine = 16, kShortRow = 512, kSets = 64, kMaxRowsOfSet = 4;
  const auto samples = static_cast<std::size_t>(width);
  if (samples < kShortRow) return samples;
  std::array<std::size_t, kSets> rows_of_set{};
  for (std::size_t y = 0; y < kSets; ++y) ++rows_of_set[y * samples / kSamplesOfLine % kSets];
  if (*std::max_element(rows_of_set.begin(), rows_of_set.end()) <= kMaxRowsOfSet) return samples;
  return ((samples + kSamplesOfLine - 1) / kSamplesOfLine | 1) * kSamplesOfLine;
}

}  // namespace

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
  const ValidHeights valid = MarkVoids(heights.data(), samples);
  if (valid.voids == samples) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "all {} x {} samples of the height field are void: at least one needs a height", width, height);
  }
  return HeightField(width, height, std::move(heights), valid.voids > 0,
                     static_cast<double>(valid.highest) - static_cast<double>(valid.lowest));
}

HeightField::HeightField(int width, int height, std::vector<float> heights, bool has_voids, double relief_m)
    : width_(width),
      height_(height),
      has_voids_(has_voids),
      quantum_(QuantumOf(heights.data(), relief_m > 0 || has_voids ? heights.size() : 1)),
      stride_(StrideFor(width)),
      heights_(std::move(heights)),
      patches_along_x_((width - 1) / kPatchSide + 1),
      patches_along_y_((height - 1) / kPatchSide + 1) {
  constexpr double kMaxQuanta = 0x1p22, kMaxNumerator = 0x1p31 - 1;
  const double relief = relief_m / static_cast<double>(quantum_);
  // For whole metres, single precision is exact except for very large triangles, and faster.
  if (quantum_ > 0 && quantum_ < 1 && !has_voids_ && relief < kMaxQuanta) {
    max_integer_area_ = static_cast<float>(std::floor(kMaxNumerator / std::max(relief, 0x1p8)));
  }
  LayOut();
  if (!has_voids_) return;
  const auto along_x = static_cast<std::size_t>(patches_along_x_);
  has_height_.resize(along_x * static_cast<std::size_t>(patches_along_y_));
  for (int y = 0; y < height_; ++y) {
    for (int column = 0; column < patches_along_x_; ++column) {
      const std::size_t patch = static_cast<std::size_t>(y / kPatchSide) * along_x + static_cast<std::size_t>(column);
      if (has_height_[patch]) continue;
      const float* begin = Row(y) + column * kPatchSide;
      const float* end = Row(y) + std::min((column + 1) * kPatchSide, width_);
      has_height_[patch] = std::any_of(begin, end, [](float value) { return !std::isnan(value); });
    }
  }
}

// Moves rows without gaps to rows that are `stride_` apart, and adds padding after the last.
void HeightField::LayOut() {
  constexpr std::size_t kSamplesOfVector = 16, kRowsOfBlock = 8;
  const float none = std::numeric_limits<float>::quiet_NaN();
  const auto width = static_cast<std::size_t>(width_), rows = static_cast<std::size_t>(height_);
  const bool is_tiny = width < kSamplesOfVector || rows < kRowsOfBlock;
  const std::size_t size = stride_ * rows + (is_tiny ? stride_ * kRowsOfBlock + kSamplesOfVector : 0);
  if (size > heights_.size()) heights_.resize(size, none);
  if (stride_ == width) return;
  for (std::size_t y = rows; y-- > 1;) {
    float* const from = heights_.data() + y * width;
    float* const to = heights_.data() + y * stride_;
    std::copy_backward(from, from + width, to + width);
    std::fill(to + width, to + stride_, none);
  }
  std::fill(heights_.data() + width, heights_.data() + stride_, none);
}

float HeightField::NearestHeight(int x, int y) const {
  // Rings of growing Chebyshev distance r, in patches: every sample on ring r is at least (r - 1) kPatchSide + 1 away.
  // A sample that is nearer than that is final; one at exactly this distance may still be tied.
  Nearest nearest{std::numeric_limits<std::int64_t>::max(), 0, 0};
  const int own_column = x / kPatchSide, own_row = y / kPatchSide;
  for (int r = 0; r < std::max(patches_along_x_, patches_along_y_); ++r) {
    const std::int64_t clearance = std::max(0, (r - 1) * kPatchSide + 1);
    if (clearance * clearance > nearest.squared_distance) break;
    for (int row = std::max(own_row - r, 0); row <= std::min(own_row + r, patches_along_y_ - 1); ++row) {
      const int step = (row == own_row - r || row == own_row + r) ? 1 : 2 * r;
      for (int column = own_column - r; column <= own_column + r; column += step) {
        if (column >= 0 && column < patches_along_x_) SearchPatch(column, row, x, y, nearest);
      }
    }
  }
  return At(nearest.x, nearest.y);
}

void HeightField::SearchPatch(int column, int row, int x, int y, Nearest& nearest) const {
  const auto along_x = static_cast<std::size_t>(patches_along_x_);
  if (!has_height_[static_cast<std::size_t>(row) * along_x + static_cast<std::size_t>(column)]) return;
  const int begin_x = column * kPatchSide, end_x = std::min(begin_x + kPatchSide, width_);
  const int begin_y = row * kPatchSide, end_y = std::min(begin_y + kPatchSide, height_);
  const std::int64_t patch_dx = std::clamp(x, begin_x, end_x - 1) - x;
  for (int sample_y = begin_y; sample_y < end_y; ++sample_y) {
    const std::int64_t row_dy = sample_y - y;
    if (patch_dx * patch_dx + row_dy * row_dy > nearest.squared_distance) continue;
    for (int sample_x = begin_x; sample_x < end_x; ++sample_x) {
      if (std::isnan(At(sample_x, sample_y))) continue;
      const std::int64_t dx = sample_x - x, dy = sample_y - y, distance = dx * dx + dy * dy;
      const bool is_first = sample_y < nearest.y || (sample_y == nearest.y && sample_x < nearest.x);
      if (distance < nearest.squared_distance || (distance == nearest.squared_distance && is_first)) {
        nearest = {distance, sample_x, sample_y};
      }
    }
  }
}

}  // namespace terrace::tin

#include "engine/tin/extended/extended_field.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace terrace::tin {
namespace {

// Of the valid heights; 1 when they are all the same.
double RangeOf(const HeightField& heights) {
  double min = std::numeric_limits<double>::infinity(), max = -min;
  for (int y = 0; y < heights.height(); ++y) {
    for (int x = 0; x < heights.width(); ++x) {
      const float height = heights.At(x, y);
      if (std::isnan(height)) continue;
      min = std::min(min, static_cast<double>(height));
      max = std::max(max, static_cast<double>(height));
    }
  }
  return max > min ? max - min : 1;
}

}  // namespace

ExtendedField::ExtendedField(HeightField heights, std::vector<Rgba> colors, double color_weight)
    : heights_(std::move(heights)),
      colors_(std::move(colors)),
      color_weight_(color_weight),
      height_weight_(1 - color_weight),
      level_weight_(color_weight * RangeOf(heights_) / 3 / 255) {}

Result<ExtendedField> ExtendedField::Make(HeightField heights, std::vector<Rgba> colors, double color_weight) {
  const std::size_t samples = static_cast<std::size_t>(heights.width()) * static_cast<std::size_t>(heights.height());
  if (colors.size() != samples) {
    return MakeError(ErrorCode::kInvalidArgument, "a field of {} x {} samples needs {} colours, not {}",
                     heights.width(), heights.height(), samples, colors.size());
  }
  if (!(color_weight >= 0 && color_weight <= 1)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "a weight of colour of {} has no meaning; use one from 0, heights alone, to 1, colours alone",
                     color_weight);
  }
  if (std::none_of(colors.begin(), colors.end(), IsKnown)) {
    return MakeError(ErrorCode::kInvalidArgument, "no sample of the field has a colour: all of them are transparent");
  }
  return ExtendedField(std::move(heights), std::move(colors), color_weight);
}

Rgb ExtendedField::NearestColor(int x, int y) const {
  std::int64_t nearest = std::numeric_limits<std::int64_t>::max();
  Rgb color{};
  for (int row = 0; row < height(); ++row) {
    for (int column = 0; column < width(); ++column) {
      const Rgba& sample = ColorAt(column, row);
      const std::int64_t dx = column - x, dy = row - y, distance = dx * dx + dy * dy;
      if (!IsKnown(sample) || distance >= nearest) continue;
      nearest = distance;
      color = {sample[0], sample[1], sample[2]};
    }
  }
  return color;
}

}  // namespace terrace::tin

#include "engine/tin/open_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace terrace::tin {
namespace {

// Whole metres, the server's own rounding, and what 32-bit surveys of low ground come in.
constexpr std::array<float, 3> kQuanta = {1, 0x1p-10F, 0x1p-14F};

bool AreMultiples(const float* begin, const float* end, float quantum) {
  const float steps_a_metre = 1 / quantum;
  bool are = true;
  for (const float* height = begin; height < end; ++height) {
    const float steps = *height * steps_a_metre;
    // A void is none; the conversion is undefined from 2^31 on.
    if (std::abs(steps) < 0x1p30F)
      are &= static_cast<float>(static_cast<std::int32_t>(steps)) == steps;
    else
      are &= std::isnan(steps);
  }
  return are;
}

float QuantumOf(const HeightField& field) {
  for (const float quantum : kQuanta) {
    int y = 0;
    while (y < field.height() && AreMultiples(field.Row(y), field.Row(y) + field.width(), quantum)) ++y;
    if (y == field.height()) return quantum;
  }
  return 0;
}

}  // namespace

OpenSamples::OpenSamples(const HeightField& field)
    : width_(field.width()), stride_(static_cast<std::size_t>(field.width())), quantum_(QuantumOf(field)) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const auto rows = static_cast<std::size_t>(field.height());
  heights_.assign(stride_ * (rows + kPaddingRows) + kPadding, none);
  for (std::size_t y = 1; y + 1 < rows; ++y) {
    const float* row = field.Row(static_cast<int>(y));
    std::copy(row + 1, row + stride_ - 1, heights_.begin() + static_cast<std::ptrdiff_t>(y * stride_ + 1));
  }
}

}  // namespace terrace::tin

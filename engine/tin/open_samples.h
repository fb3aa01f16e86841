// The samples of a field that may still become vertices inside it: what triangles are scanned for.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "engine/tin/height_field.h"
#include "engine/tin/tin_mesh.h"

namespace terrace::tin {

// A copy of the field in which everything else is NaN: voids, vertices, and the border, which is judged by a rule of
// its own (border.h). No comparison with NaN holds, so that a scan needs no test for any of them.
class OpenSamples {
 public:
  // What may be read beyond the last row: a scan loads whole vectors, and small boxes whole.
  static constexpr std::size_t kPaddingRows = 8, kPadding = 16;

  explicit OpenSamples(const HeightField& field)
      : width_(field.width()), stride_(static_cast<std::size_t>(field.width())) {
    const float none = std::numeric_limits<float>::quiet_NaN();
    const auto rows = static_cast<std::size_t>(field.height());
    heights_.assign(stride_ * (rows + kPaddingRows) + kPadding, none);
    for (std::size_t y = 1; y + 1 < rows; ++y) {
      const float* row = field.Row(static_cast<int>(y));
      std::copy(row + 1, row + stride_ - 1, heights_.begin() + static_cast<std::ptrdiff_t>(y * stride_ + 1));
    }
    quantum_ = QuantumOf(field);
  }

  void Close(SamplePosition sample) {
    heights_[sample.y * stride_ + sample.x] = std::numeric_limits<float>::quiet_NaN();
  }

  // NaN where not open.
  float At(SamplePosition sample) const { return heights_[sample.y * stride_ + sample.x]; }

  // A power of two that all heights of the field are multiples of, metres; 0 where none was found.
  float quantum() const { return quantum_; }

  int width() const { return width_; }
  const float* Row(int y) const { return heights_.data() + static_cast<std::size_t>(y) * stride_; }

 private:
  static float QuantumOf(const HeightField& field) {
    for (const float quantum : {1.0F, 0x1p-10F, 0x1p-14F}) {
      const float inverse = 1 / quantum;
      bool fits = true;
      for (int y = 0; y < field.height() && fits; ++y) {
        for (const float* height = field.Row(y); height < field.Row(y) + field.width(); ++height) {
          const float steps = *height * inverse;
          fits &= !(std::abs(steps) >= 0x1p30F || static_cast<float>(static_cast<std::int32_t>(steps)) != steps) || *height != *height;
        }
      }
      if (fits) return quantum;
    }
    return 0;
  }

  float quantum_ = 0;
  int width_;
  std::size_t stride_;
  std::vector<float> heights_;
};

}  // namespace terrace::tin

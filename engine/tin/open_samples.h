// The samples of a field that may still become vertices inside it: what triangles are scanned for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "engine/tin/height_field.h"
#include "engine/tin/spare_blocks.h"
#include "engine/tin/tin_mesh.h"

namespace terrace::tin {

// A copy of the field in which everything else is NaN: voids, vertices, and the border, which is judged by a rule of
// its own (border.h). No comparison with NaN holds, so that a scan needs no test for any of them.
class OpenSamples {
 public:
  // What may be read beyond the last row: a scan loads whole vectors, and small boxes whole.
  static constexpr std::size_t kPaddingRows = 8, kPadding = 16;

  explicit OpenSamples(const HeightField& field);

  void Close(SamplePosition sample) {
    heights_[sample.y * stride_ + sample.x] = std::numeric_limits<float>::quiet_NaN();
  }

  // NaN where not open.
  float At(SamplePosition sample) const { return heights_[sample.y * stride_ + sample.x]; }

  // The same of a sample by its row-major index.
  float At(std::uint32_t sample) const {
    const auto width = static_cast<std::uint32_t>(width_);
    return stride_ == width ? heights_[sample] : heights_[sample / width * stride_ + sample % width];
  }

  // A power of two that all heights of the field are multiples of, metres; 0 if none is known. Sums and products by
  // integers are exact in single precision as long as they stay below 2^24 of it.
  float quantum() const { return quantum_; }

  int width() const { return width_; }

  // Samples from one row to the next.
  int stride() const { return static_cast<int>(stride_); }
  const float* Row(int y) const { return heights_.data() + static_cast<std::size_t>(y) * stride_; }

 private:
  int width_;
  std::size_t stride_;
  LargeArray<float> heights_;
  float quantum_ = 0;
};

}  // namespace terrace::tin

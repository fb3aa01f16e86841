#include "engine/statistics/kept_factors.h"

#include <algorithm>
#include <cstdint>

namespace terrace::dem {
namespace {

// Whether ReadAverages starts from too many samples.
bool IsFarFromItsStart(const RasterLayout& layout, int factor) {
  constexpr std::int64_t kMaxReadWhole = std::int64_t{512} * 512;
  const int start = StartingFactor(layout, factor);
  const std::int64_t samples = std::int64_t{DivideUp(layout.width, start)} * DivideUp(layout.height, start);
  return start < factor && samples > kMaxReadWhole;
}

}  // namespace

unsigned KeptFactors(const RasterLayout& layout) {
  unsigned factors = 0;
  for (int factor = 2; factor < kLargestMeasuredFactor; factor *= 2) {
    if (factor / 2 < std::max(layout.width, layout.height) && IsFarFromItsStart(layout, factor)) {
      factors |= static_cast<unsigned>(factor);
    }
  }
  return factors;
}

bool KeepsCoarse(const RasterLayout& layout) {
  if (layout.overview_factors.empty()) return true;
  for (int factor = kLargestMeasuredFactor; factor / 2 < std::max(layout.width, layout.height); factor *= 2) {
    if (IsFarFromItsStart(layout, factor)) return true;
  }
  return false;
}

}  // namespace terrace::dem

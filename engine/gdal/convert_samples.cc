#include "engine/gdal/convert_samples.h"

#include <cstdint>
#include <limits>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/gdal/convert_samples.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class D, typename Raw>
HWY_INLINE hn::Vec<D> LoadFloats(D d, const Raw* raw) {
  if constexpr (std::is_same_v<Raw, float>) {
    return hn::LoadU(d, raw);
  } else {
    return hn::ConvertTo(d, hn::PromoteTo(hn::RebindToSigned<D>(), hn::LoadU(hn::Rebind<Raw, D>(), raw)));
  }
}

template <class D, typename Raw>
HWY_INLINE void ConvertVector(D d, const Raw* raw, const HeightLimits& limits, float* heights) {
  const auto height = hn::Add(LoadFloats(d, raw), hn::Zero(d));  // turns -0 into 0
  const auto is_within = hn::And(hn::Ge(height, hn::Set(d, limits.lowest)), hn::Le(height, hn::Set(d, limits.highest)));
  // Not Ne, which is false for NaN with some sets of instructions.
  const auto is_valid = hn::AndNot(hn::Eq(height, hn::Set(d, limits.nodata)), is_within);
  hn::StoreU(hn::IfThenElse(is_valid, height, hn::Set(d, std::numeric_limits<float>::quiet_NaN())), d, heights);
}

template <typename Raw>
void ConvertAll(const std::byte* bytes, std::size_t count, const HeightLimits& limits, float* heights) {
  const auto* const raw = reinterpret_cast<const Raw*>(bytes);
  const hn::ScalableTag<float> d;
  const hn::CappedTag<float, 1> single;
  std::size_t i = 0;
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d)) ConvertVector(d, raw + i, limits, heights + i);
  for (; i < count; ++i) ConvertVector(single, raw + i, limits, heights + i);
}

void Convert(GDALDataType type, const std::byte* raw, std::size_t count, const HeightLimits& limits, float* heights) {
  switch (type) {
    case GDT_Byte:
      return ConvertAll<std::uint8_t>(raw, count, limits, heights);
    case GDT_Int16:
      return ConvertAll<std::int16_t>(raw, count, limits, heights);
    case GDT_UInt16:
      return ConvertAll<std::uint16_t>(raw, count, limits, heights);
    default:
      return ConvertAll<float>(raw, count, limits, heights);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(Convert);

}  // namespace

void ConvertSamples(GDALDataType type, const std::byte* raw, std::size_t count, const HeightLimits& limits,
                    float* heights) {
  HWY_DYNAMIC_DISPATCH(Convert)(type, raw, count, limits, heights);
}

}  // namespace terrace::dem
#endif

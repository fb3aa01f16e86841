#include "engine/raster/nan_heights.h"

#include <algorithm>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/raster/nan_heights.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::dem {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

bool AreAllKnown(const float* heights, std::size_t count) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  auto sum = hn::Zero(d);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) sum = hn::Add(sum, hn::LoadU(d, heights + i));  // NaN if one is
  bool are_known = hn::AllTrue(d, hn::Eq(sum, sum));
  for (; i < count; ++i) are_known &= heights[i] == heights[i];
  return are_known;
}

std::size_t VoidsAmong(const float* heights, std::size_t count) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0, voids = 0;
  for (; i + lanes <= count; i += lanes) voids += hn::CountTrue(d, hn::IsNaN(hn::LoadU(d, heights + i)));
  for (; i < count; ++i) voids += heights[i] != heights[i] ? 1 : 0;
  return voids;
}

void Replace(float* heights, std::size_t count, float by) {
  const hn::CappedTag<float, 16> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto here = hn::LoadU(d, heights + i);
    hn::StoreU(hn::IfThenElse(hn::IsNaN(here), hn::Set(d, by), here), d, heights + i);
  }
  for (; i < count; ++i) heights[i] = heights[i] == heights[i] ? heights[i] : by;
}

bool MarkWanted(const std::uint8_t* inside, const float* heights, std::size_t count, std::uint8_t* wanted) {
  const hn::CappedTag<float, 16> d;
  const hn::RebindToSigned<decltype(d)> words;
  const hn::Rebind<std::int16_t, decltype(d)> halves;
  const hn::Rebind<std::int8_t, decltype(d)> bytes;
  const hn::RebindToUnsigned<decltype(bytes)> marks;
  const std::size_t lanes = hn::Lanes(d);
  auto all = hn::Zero(marks);
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto is_void = hn::VecFromMask(words, hn::RebindMask(words, hn::IsNaN(hn::LoadU(d, heights + i))));
    const auto here =
        hn::And(hn::BitCast(marks, hn::DemoteTo(bytes, hn::DemoteTo(halves, is_void))), hn::LoadU(marks, inside + i));
    hn::StoreU(here, marks, wanted + i);
    all = hn::Or(all, here);
  }
  bool is_any = !hn::AllTrue(marks, hn::Eq(all, hn::Zero(marks)));
  for (; i < count; ++i) {
    wanted[i] = heights[i] != heights[i] ? inside[i] : 0;
    is_any |= wanted[i] != 0;
  }
  return is_any;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::dem
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::dem {
namespace {

HWY_EXPORT(AreAllKnown);
HWY_EXPORT(VoidsAmong);
HWY_EXPORT(Replace);
HWY_EXPORT(MarkWanted);

}  // namespace

// Copies are several times as fast as loops that store one height at a time.
std::vector<float> NaNHeights(std::size_t count) {
  static const std::vector<float> row(1024, std::numeric_limits<float>::quiet_NaN());
  std::vector<float> heights;
  heights.reserve(count);
  while (heights.size() < count) {
    const std::size_t more = std::min(row.size(), count - heights.size());
    heights.insert(heights.end(), row.begin(), row.begin() + static_cast<std::ptrdiff_t>(more));
  }
  return heights;
}

void FillWith(float height, std::span<float> heights) {
  constexpr std::size_t kFirst = 256;
  std::size_t done = std::min(kFirst, heights.size());
  std::fill_n(heights.begin(), done, height);
  while (done < heights.size()) {
    const std::size_t more = std::min(kFirst, heights.size() - done);
    std::copy_n(heights.begin(), more, heights.begin() + static_cast<std::ptrdiff_t>(done));
    done += more;
  }
}

bool HasVoids(std::span<const float> heights) {
  return !HWY_DYNAMIC_DISPATCH(AreAllKnown)(heights.data(), heights.size());
}

std::size_t CountVoids(std::span<const float> heights) {
  return HWY_DYNAMIC_DISPATCH(VoidsAmong)(heights.data(), heights.size());
}

void ReplaceVoids(std::span<float> heights, float by) {
  HWY_DYNAMIC_DISPATCH(Replace)(heights.data(), heights.size(), by);
}

bool WantVoids(std::span<const std::uint8_t> inside, std::span<const float> heights, std::span<std::uint8_t> wanted) {
  return HWY_DYNAMIC_DISPATCH(MarkWanted)(inside.data(), heights.data(), heights.size(), wanted.data());
}

}  // namespace terrace::dem
#endif

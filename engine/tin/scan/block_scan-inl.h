// The scan of small triangles: computes the planes of a star together, then scans each triangle as a block of samples
// with a few rows per vector. Compiled once for each instruction set; part of triangle_scan.cc.
#if defined(TERRACE_ENGINE_TIN_BLOCK_SCAN_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TERRACE_ENGINE_TIN_BLOCK_SCAN_INL_H_
#undef TERRACE_ENGINE_TIN_BLOCK_SCAN_INL_H_
#else
#define TERRACE_ENGINE_TIN_BLOCK_SCAN_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/scan/wide_scan-inl.h"

#if HWY_TARGET != HWY_SCALAR

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

// Blocks of kSide x kSide samples, a few rows per vector.
constexpr int kMaxLanes = 16;
HWY_ALIGN constexpr float kColumnsBy4[kMaxLanes] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
HWY_ALIGN constexpr float kRowsBy4[kMaxLanes] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};
HWY_ALIGN constexpr float kColumnsBy8[kMaxLanes] = {0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7};
HWY_ALIGN constexpr float kRowsBy8[kMaxLanes] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1};

#if HWY_MAX_BYTES >= 32
constexpr int kLargeSide = 8;
#else
constexpr int kLargeSide = 4;
#endif

template <int kSide>
HWY_INLINE Floats RowsFrom(const float* from, int stride) {
  constexpr int kRowsAtOnce = static_cast<int>(hn::MaxLanes(kFloats)) / kSide;
  if constexpr (kRowsAtOnce == 1) {
    static_cast<void>(stride);
    return hn::LoadU(kFloats, from);
  } else if constexpr (kRowsAtOnce == 2) {
    const hn::Half<decltype(kFloats)> row;
    return hn::Combine(kFloats, hn::LoadU(row, from + stride), hn::LoadU(row, from));
  } else {
    const hn::Half<decltype(kFloats)> two;
    const hn::Half<decltype(two)> row;
    return hn::Combine(kFloats, hn::Combine(two, hn::LoadU(row, from + 3 * stride), hn::LoadU(row, from + 2 * stride)),
                       hn::Combine(two, hn::LoadU(row, from + stride), hn::LoadU(row, from)));
  }
}

// Keeps doubled areas, and the terms of barycentric coordinates, below 2^24.
constexpr int kMaxExtent = 2048;
// Above this, single precision may overflow.
constexpr float kMaxMagnitude = 0x1p100F;

// Sets all bits, which is NaN, in lanes where one of the barycentric coordinates is negative; comparisons with NaN are
// false. No coordinate is zero, because they lie halfway between integers.
HWY_INLINE Floats NaNWhereNegative(Floats a, Floats b, Floats c) {
  const NumberTag<FloatsTag> ints;
  return hn::BitCast(kFloats, hn::ShiftRight<31>(hn::BitCast(ints, hn::Or3(a, b, c))));
}

// The planes of as many triangles of a star as there are lanes, in single precision.
struct StarPlanes {
  static constexpr std::size_t kMaxFloats = hn::MaxLanes(kFloats);

  HWY_INLINE void Work(const HeightField& field, const Star& star, std::size_t first) {
    const std::int32_t *dx = star.ring.dx.data() + first, *dy = star.ring.dy.data() + first;
    const float* heights = star.ring.heights.data() + first;
    const auto u_x = hn::LoadU(kInts, dx), v_x = hn::LoadU(kInts, dx + 1), none = hn::Zero(kInts);
    const auto u_y = hn::LoadU(kInts, dy), v_y = hn::LoadU(kInts, dy + 1);
    const auto low_x = hn::Min(hn::Min(u_x, v_x), none), high_x = hn::Max(hn::Max(u_x, v_x), none);
    const auto low_y = hn::Min(hn::Min(u_y, v_y), none), high_y = hn::Max(hn::Max(u_y, v_y), none);
    const Floats pz = All(kFloats, star.height);
    const Floats u_z = hn::Sub(hn::LoadU(kFloats, heights), pz), v_z = hn::Sub(hn::LoadU(kFloats, heights + 1), pz);
    const Floats of_ux = hn::ConvertTo(kFloats, u_x), of_uy = hn::ConvertTo(kFloats, u_y);
    const Floats of_vx = hn::ConvertTo(kFloats, v_x), of_vy = hn::ConvertTo(kFloats, v_y);
    const Floats of_d = hn::Sub(hn::Mul(of_ux, of_vy), hn::Mul(of_uy, of_vx));
    hn::Store(of_ux, kFloats, ux);
    hn::Store(of_uy, kFloats, uy);
    hn::Store(of_vx, kFloats, vx);
    hn::Store(of_vy, kFloats, vy);
    hn::Store(of_d, kFloats, d);
    const auto wide = hn::Sub(high_x, low_x), high = hn::Sub(high_y, low_y), extent = hn::Max(wide, high);
    const auto is_small = hn::Lt(extent, All(kInts, 4)), is_block = hn::Lt(extent, All(kInts, kLargeSide));
    auto from_x = low_x, from_y = low_y, reach_x = wide, reach_y = high;
    // Moves blocks that would end beyond the field.
    if (star.x + kLargeSide > field.width() || star.y + kLargeSide > field.height()) {
      const auto side = hn::IfThenElse(is_small, All(kInts, 4), All(kInts, kLargeSide));
      const auto latest = [&](int at, int size)
                              HWY_ATTR { return hn::Max(hn::Sub(All(kInts, size - at), side), All(kInts, -at)); };
      from_x = hn::IfThenElse(is_block, hn::Min(low_x, latest(star.x, field.width())), low_x);
      from_y = hn::IfThenElse(is_block, hn::Min(low_y, latest(star.y, field.height())), low_y);
      reach_x = hn::IfThenElse(hn::Eq(from_x, low_x), wide, side);
      reach_y = hn::IfThenElse(hn::Eq(from_y, low_y), high, side);
    }
    const Floats of_west = hn::ConvertTo(kFloats, from_x), of_south = hn::ConvertTo(kFloats, from_y);
    const Floats half = All(kFloats, 0.5);
    hn::Store(hn::NegMulAdd(of_vx, of_south, hn::MulAdd(of_vy, of_west, half)), kFloats, u);
    hn::Store(hn::NegMulAdd(of_uy, of_west, hn::MulAdd(of_ux, of_south, half)), kFloats, v);
    hn::Store(hn::Add(All(kFloats, 1.5), of_d), kFloats, sum);
    if (star.has_border) LeaveBorderOut(field, star, u_x, u_y, v_x, v_y);
    const Floats vy_uz = hn::Mul(of_vy, u_z), uy_vz = hn::Mul(of_uy, v_z);
    const Floats ux_vz = hn::Mul(of_ux, v_z), vx_uz = hn::Mul(of_vx, u_z);
    const Floats of_a = hn::Sub(vy_uz, uy_vz), of_b = hn::Sub(ux_vz, vx_uz);
    hn::Store(of_a, kFloats, a);
    hn::Store(of_b, kFloats, b);
    hn::Store(hn::Add(hn::Mul(of_a, of_west), hn::Mul(of_b, of_south)), kFloats, plane);
    hn::Store(from_x, kInts, west);
    hn::Store(from_y, kInts, south);
    hn::Store(wide, kInts, width);
    hn::Store(high, kInts, height);
    // The largest distances from p of the triangle's columns and rows and of its block.
    const Floats across = hn::ConvertTo(kFloats, reach_x), up = hn::ConvertTo(kFloats, reach_y);
    const Floats of_x = hn::Add(hn::Abs(vy_uz), hn::Abs(uy_vz)), of_y = hn::Add(hn::Abs(ux_vz), hn::Abs(vx_uz));
    const Floats max_plane = hn::Add(hn::Mul(hn::Abs(of_a), across), hn::Mul(hn::Abs(of_b), up));
    const Floats of_magnitude = hn::Add(hn::Mul(of_x, across), hn::Mul(of_y, up));
    hn::Store(hn::Add(hn::Add(of_x, of_y), max_plane), kFloats, largest);
    hn::Store(of_magnitude, kFloats, magnitude);

    const auto is_exact = hn::RebindMask(kFloats, hn::Lt(extent, All(kInts, kMaxExtent + 1)));  // then of_d is exact
    // Pick's theorem: a triangle of doubled area 1 has no samples but its corners.
    const auto has_samples = hn::Or(hn::Ne(of_d, All(kFloats, 1)), hn::Not(is_exact));
    const auto is_tame = hn::And(hn::Lt(of_magnitude, All(kFloats, kMaxMagnitude)), is_exact);
    const std::uint32_t lanes = BitsOf(kFloats, has_samples), tame = lanes & BitsOf(kFloats, is_tame);
    small = tame & BitsOf(kFloats, hn::RebindMask(kFloats, is_small));
    medium = tame & BitsOf(kFloats, hn::RebindMask(kFloats, is_block)) & ~small;
    wild = lanes & ~tame;
    large = tame & ~small & ~medium;
  }

  HWY_ALIGN float ux[kMaxFloats], uy[kMaxFloats], vx[kMaxFloats], vy[kMaxFloats], d[kMaxFloats], a[kMaxFloats],
      b[kMaxFloats];
  // At the first sample of the block, or of the bounding box for triangles that are no blocks: barycentric coordinates
  // of u and v, plus 1/2, and A x + B y. `sum`: of all three coordinates, plus 3/2. Each edge on the border
  // subtracts 1.
  HWY_ALIGN float u[kMaxFloats], v[kMaxFloats], sum[kMaxFloats], plane[kMaxFloats];
  HWY_ALIGN float largest[kMaxFloats];                         // bound on all products and sums of the plane
  HWY_ALIGN float magnitude[kMaxFloats];                       // the magnitude that rounding errors are relative to
  HWY_ALIGN std::int32_t west[kMaxFloats], south[kMaxFloats];  // first column and row of the block or the bounding box
  HWY_ALIGN std::int32_t width[kMaxFloats], height[kMaxFloats];  // of the bounding box
  std::uint32_t small, medium, large, wild;                      // sets of lanes

 private:
  // Makes samples on an edge along the field's border lie outside.
  HWY_INLINE void LeaveBorderOut(const HeightField& field, const Star& star, Ints u_x, Ints u_y, Ints v_x, Ints v_y) {
    const auto is_along = [](Ints a, Ints b, int at, int size) HWY_ATTR {
      const auto is_end = hn::Or(hn::Eq(a, All(kInts, -at)), hn::Eq(a, All(kInts, size - 1 - at)));
      return hn::RebindMask(kFloats, hn::And(hn::Eq(a, b), is_end));
    };
    const auto is_on_border = [&](Ints a_x, Ints a_y, Ints b_x, Ints b_y) HWY_ATTR {
      return hn::Or(is_along(a_x, b_x, star.x, field.width()), is_along(a_y, b_y, star.y, field.height()));
    };
    const auto p = hn::Zero(kInts);
    const Floats one = All(kFloats, 1);
    const Floats from_u = hn::IfThenElseZero(is_on_border(v_x, v_y, p, p), one);
    const Floats from_v = hn::IfThenElseZero(is_on_border(p, p, u_x, u_y), one);
    const Floats from_p = hn::IfThenElseZero(is_on_border(u_x, u_y, v_x, v_y), one);
    hn::Store(hn::Sub(hn::Load(kFloats, u), from_u), kFloats, u);
    hn::Store(hn::Sub(hn::Load(kFloats, v), from_v), kFloats, v);
    hn::Store(hn::Sub(hn::Load(kFloats, sum), hn::Add(hn::Add(from_u, from_v), from_p)), kFloats, sum);
  }
};

// Single precision against double. With u = 2^-24 and the numerator N = |D (h - z_p) - (A x + B y)|, two roundings are
// relative to D (h - z_p), which is at most N + magnitude; five are relative to A x + B y and its terms; one to N. The
// total is 3 u N + 7 u magnitude; the errors of double are negligible. A sample that is the furthest in double is
// therefore within 2^-20 (N + magnitude) of the furthest in single precision. Nothing underflows: every factor but one
// is an integer.
constexpr float kDoubt = 0x1p-20F;

// In blocks a plane is evaluated at the block's corner, then at the lane, and then stepped up to seven times. The error
// is below 3 u N + 24 u magnitude, fused or not. Two samples that are compared may have errors of opposite sign.
constexpr float kDoubtInBlocks = 0x1p-18F;

// Given the largest numerator in single precision, returns the smallest numerator that may be the largest in double;
// the same one if single precision is exact. Never negative, because negative numerators are not samples of the
// triangle.
HWY_INLINE float MinUncertain(float most, float largest, float magnitude, float max_exact, float doubt) {
  const float least = std::max(most - doubt * (most + magnitude), 0.0F);
  return most + largest < max_exact ? most : least;
}

// Scans one block from (west, south) relative to p. `most`: the largest numerator, negative if there is no sample.
// `found`: bits of the samples that have it, or may have it in double, row by row. Branches only for inexact results,
// which come in runs or are rare; other branches would be mispredicted.
struct BlockFind {
  float most;
  std::uint64_t found;
};
template <int kSide>
HWY_INLINE BlockFind ScanBlock(const HeightField& field, const Star& star, const StarPlanes& planes, std::size_t i,
                               float max_exact) {
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats)), kRowsAtOnce = kLanes / kSide;
  constexpr int kVectors = kSide * kSide / kLanes;
  const Floats x = hn::Load(kFloats, kSide == 4 ? kColumnsBy4 : kColumnsBy8);
  const Floats y = hn::Load(kFloats, kSide == 4 ? kRowsBy4 : kRowsBy8);
  const Floats ux = All(kFloats, planes.ux[i]), vx = All(kFloats, planes.vx[i]), d = All(kFloats, planes.d[i]);
  const Floats b = All(kFloats, planes.b[i]), pz = All(kFloats, star.height);
  Floats of_u = hn::NegMulAdd(vx, y, hn::MulAdd(All(kFloats, planes.vy[i]), x, All(kFloats, planes.u[i])));
  Floats of_v = hn::NegMulAdd(All(kFloats, planes.uy[i]), x, hn::MulAdd(ux, y, All(kFloats, planes.v[i])));
  Floats of_p = hn::Sub(All(kFloats, planes.sum[i]), hn::Add(of_u, of_v));
  Floats plane = hn::MulAdd(b, y, hn::MulAdd(All(kFloats, planes.a[i]), x, All(kFloats, planes.plane[i])));
  const Floats at_once = All(kFloats, kRowsAtOnce);
  const Floats step_u = hn::Mul(vx, at_once), step_v = hn::Mul(ux, at_once), step_p = hn::Sub(step_u, step_v);
  const Floats step_plane = hn::Mul(b, at_once);

  const int stride = field.stride();
  const float* const from = field.Row(star.y + planes.south[i]) + star.x + planes.west[i];
  Floats numerators[kVectors];
  Floats most = All(kFloats, -1);
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    const Floats heights = RowsFrom<kSide>(from + k * kRowsAtOnce * stride, stride);
    const Floats numerator = hn::Abs(hn::MulSub(d, hn::Sub(heights, pz), plane));
    numerators[k] = hn::Or(numerator, NaNWhereNegative(of_u, of_v, of_p));
    most = MaxOrSecond(numerators[k], most);
    plane = hn::Add(plane, step_plane);
    of_u = hn::Sub(of_u, step_u);
    of_v = hn::Add(of_v, step_v);
    of_p = hn::Add(of_p, step_p);
  }
  Floats least = hn::MaxOfLanes(kFloats, most);
  BlockFind find{hn::GetLane(least), 0};
  if (!(find.most + planes.largest[i] < max_exact)) [[unlikely]]
    least = All(kFloats, MinUncertain(find.most, planes.largest[i], planes.magnitude[i], max_exact, kDoubtInBlocks));
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    find.found |= std::uint64_t{BitsOf(kFloats, hn::Ge(numerators[k], least))} << (k * kLanes);
  }
  return find;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#endif  // HWY_TARGET != HWY_SCALAR

#endif  // per-target include guard
